"""A managed robot over DDS: its lifecycle, walked through by a client."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from lifecycle_msgs.msg import TransitionEvent
from lifecycle_msgs.srv import (
    ChangeState,
    GetAvailableStates,
    GetAvailableTransitions,
    GetState,
)
from rclpy.lifecycle import LifecycleNode
from std_srvs.srv import SetBool
from tests.ros.robot_process import Client, RobotProcess, wait_until
from tests.ros.test_client_commands import robotd
from tests.ros.test_trajectory import goal, pose
from wmx_ros2_message.srv import SetAxis

pytestmark = [pytest.mark.daily, pytest.mark.ros]

NODE = "/wmx_engine_node"
INACTIVE = "the robot is inactive: its lifecycle manager has to activate it"
WALK = ("configure", "activate", "deactivate", "cleanup")
STATES = ("inactive", "active", "inactive", "unconfigured")


@pytest.fixture
def managed() -> Iterator[RobotProcess]:
    """A robot of the test's own: its states last, and one test ends it."""
    arguments = ("--ros-args", "-p", "wmx_engine_node:managed:=true")
    with RobotProcess(*arguments, backend="sim") as process:
        process.wait_output("waiting for the transition configure")
        yield process


@pytest.fixture
def manager(managed: RobotProcess) -> Iterator[Client]:
    client = Client(managed.domain)
    yield client
    client.close()


def change(manager: Client, label: str) -> bool:
    request = ChangeState.Request().transition
    request.label = label
    return bool(manager.call(ChangeState, f"{NODE}/change_state", transition=request).success)


def state(manager: Client) -> str:
    return str(manager.call(GetState, f"{NODE}/get_state").current_state.label)


def edges(response: Any) -> set[tuple[int, str, int, int]]:
    return {
        (
            transition.transition.id,
            transition.transition.label,
            transition.start_state.id,
            transition.goal_state.id,
        )
        for transition in response.available_transitions
    }


def test_states_and_transitions_are_those_of_a_lifecycle_node_of_rclpy(manager: Client) -> None:
    reference = LifecycleNode("reference", context=manager.host.context)
    manager.host.add_node(reference)
    for service_type, name in (
        (GetAvailableTransitions, "get_transition_graph"),
        (GetAvailableTransitions, "get_available_transitions"),
    ):
        here, there = (
            manager.call(service_type, f"{node}/{name}") for node in (NODE, "/reference")
        )
        assert edges(here) == edges(there)
    here, there = (
        manager.call(GetAvailableStates, f"{node}/get_available_states").available_states
        for node in (NODE, "/reference")
    )
    assert {(transition.id, transition.label) for transition in here} == {
        (transition.id, transition.label) for transition in there
    }


def test_a_client_walks_through_the_states_twice(managed: RobotProcess, manager: Client) -> None:
    events = manager.listen(TransitionEvent, f"{NODE}/transition_event")
    assert state(manager) == "unconfigured"
    for _ in range(2):
        for label, reached in zip(WALK, STATES, strict=True):
            assert change(manager, label), managed.output
            assert state(manager) == reached
            if reached == "inactive":
                status, result = manager.send_goal(goal((1.0, pose(0.1)))).result()
                assert (status, result.error_string) == (GoalStatus.STATUS_ABORTED, INACTIVE)
            if reached == "active":
                status, result = manager.send_goal(goal((1.0, pose(0.1)))).result()
                assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    wait_until(lambda: len(events) == 4 * len(WALK), "two events for each transition")
    assert [event.transition.label for event in events[:2]] == ["configure", "transition_success"]
    assert events[1].goal_state.label == "inactive"


def test_only_the_lifecycle_starts_and_stops_a_managed_robot(
    managed: RobotProcess, manager: Client
) -> None:
    assert change(manager, "configure")
    status, output, _ = robotd(managed.domain, "status")
    assert (status, "the robot is inactive" in output) == (1, True), output
    assert "Its lifecycle manager has to activate it" in output
    response = manager.call(SetAxis, "/wmx/axis/set_on", index=[0], data=[1])
    assert (response.success, INACTIVE in response.message) == (False, True), response.message
    response = manager.call(SetBool, "/wmx/engine/set_comm", data=False)
    assert (response.success, f"use {NODE}/change_state" in response.message) == (False, True)
    assert not change(manager, "configure")
    assert state(manager) == "inactive"
    assert change(manager, "activate")


def test_the_transition_shutdown_ends_the_process(managed: RobotProcess, manager: Client) -> None:
    assert change(manager, "shutdown")
    assert managed.exit_status() == 0
    assert "lifecycle manager" in managed.output
