"""The gripper of the SO-101 is a joint: its actions, its service, and ``robotd gripper``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from control_msgs.action import GripperCommand, ParallelGripperCommand
from sensor_msgs.msg import JointState
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import WAIT_S, Client, RobotProcess, connected, wait_for
from tests.ros.test_client_commands import robotd

pytestmark = pytest.mark.ros

OPEN, CLOSED = 1.7, -0.17
SINGLE, PARALLEL = "/gripper_controller/gripper_cmd", "/parallel_gripper_controller/gripper_cmd"


@pytest.fixture(scope="module")
def so101() -> Iterator[RobotProcess]:
    with RobotProcess(robot="so101", backend="sim", simulated_time=True) as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def client(so101: RobotProcess) -> Iterator[Client]:
    with connected(so101) as client:
        yield client


def result(client: Client, action_type: Any, name: str, goal: Any) -> Any:
    """Return the result of a goal; None: it was rejected."""
    actions = GoalClient(client.node, action_type, name)
    assert actions.wait_for_server(WAIT_S)
    handle = wait_for(actions.send_goal_async(goal))
    if not handle.accepted:
        return None
    answer = wait_for(handle.get_result_async())
    assert answer.status == GoalStatus.STATUS_SUCCEEDED
    return answer.result


def to(client: Client, position: float) -> Any:
    goal = GripperCommand.Goal()
    goal.command.position = position
    return result(client, GripperCommand, SINGLE, goal)


def test_it_goes_to_the_position_of_a_goal(client: Client) -> None:
    for position in (0.8, OPEN):
        found = to(client, position)
        assert (found.reached_goal, found.stalled) == (True, False)
        assert found.position == pytest.approx(position, abs=0.01)
    assert to(client, 2.5) is None


def test_the_parallel_action_names_its_joint(client: Client) -> None:
    goal = ParallelGripperCommand.Goal()
    goal.command.name, goal.command.position = ["gripper"], [0.5]
    found = result(client, ParallelGripperCommand, PARALLEL, goal)
    assert list(found.state.name) == ["gripper"]
    assert list(found.state.position) == pytest.approx([0.5], abs=0.01)
    goal.command.name = ["wrist_roll"]
    assert result(client, ParallelGripperCommand, PARALLEL, goal) is None


def test_the_command_opens_and_closes_it(so101: RobotProcess, client: Client) -> None:
    for command, text, position in (
        ("close", "gripper is closed", CLOSED), ("open", "gripper is open", OPEN)
    ):  # fmt: skip
        status, output, _ = robotd(so101.domain, "gripper", command)
        assert (status, text in output) == (0, True), output
        states = client.listen(JointState, "/joint_states")
        state = client.next(states, lambda state: len(state.name) == 6)
        assert state.name[-1] == "gripper"
        assert state.position[-1] == pytest.approx(position, abs=0.01)
