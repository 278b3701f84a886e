"""The hand by GripperCommand: widths, forces, parts, canceling and preemption on franky-sim."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from control_msgs.action import GripperCommand
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from tests.plugins.franka.controller import Controller, controller, needs_simulator
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import (
    WAIT_S,
    Client,
    RobotProcess,
    connected,
    wait_for,
    wait_until,
)

pytestmark = [needs_simulator, pytest.mark.ros, pytest.mark.long]

ACTION = "/fr3_gripper/gripper_action"
NEAR_M = 0.002  # of one finger


@pytest.fixture(scope="module")
def unit() -> Iterator[Controller]:
    with controller() as found:
        yield found


@pytest.fixture(scope="module")
def client(unit: Controller) -> Iterator[Client]:
    arguments = ("--set", f"backends.franka.address={unit.address}", "--variant", "hand")
    with RobotProcess(*arguments, robot="fr3", backend="franka") as process:
        process.wait_ready()
        with connected(process) as client:
            yield client


@pytest.fixture
def hand(client: Client, unit: Controller) -> GoalClient:
    """Client of the open hand, with nothing between its fingers."""
    actions = GoalClient(client.node, GripperCommand, ACTION)
    assert actions.wait_for_server(WAIT_S)
    unit.command(part=0.0)
    assert ended(send(actions, 0.04))[1].reached_goal
    return actions


def send(actions: GoalClient, position_m: float, force_n: float = 0.0) -> Any:
    goal = GripperCommand.Goal()
    goal.command.position, goal.command.max_effort = position_m, force_n
    handle = wait_for(actions.send_goal_async(goal))
    assert handle.accepted
    return handle


def ended(handle: Any) -> tuple[int, Any]:
    answer = wait_for(handle.get_result_async())
    return answer.status, answer.result


def closing(unit: Controller, actions: GoalClient) -> Any:
    """Return a goal that closes the fingers, which have moved."""
    handle = send(actions, 0.0)
    wait_until(lambda: unit.command().width < 0.07, "the fingers close")
    return handle


def test_it_closes_on_nothing_and_is_shown(
    client: Client, hand: GoalClient, unit: Controller
) -> None:
    states = client.listen(JointState, "/joint_states")
    assert client.next(states).name[7:] == ["fr3_finger_joint1", "fr3_finger_joint2"]
    status, result = ended(send(hand, 0.0))
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert (result.reached_goal, result.stalled) == (True, False)
    assert result.position == pytest.approx(unit.command().width / 2, abs=1e-3)
    assert unit.command().width == pytest.approx(0.0, abs=NEAR_M)
    wait_until(lambda: client.next(states).position[7] < NEAR_M, "closed joint states")


def test_it_goes_to_a_width_between_its_ends(hand: GoalClient, unit: Controller) -> None:
    before = unit.command().hand_commands
    status, result = ended(send(hand, 0.02))
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert result.reached_goal
    assert unit.command().width == pytest.approx(0.04, abs=2 * NEAR_M)
    assert unit.command().hand_commands == [*before, "move"]


def test_a_part_stalls_it_with_a_force_and_is_released(hand: GoalClient, unit: Controller) -> None:
    unit.command(part=0.03)
    status, result = ended(send(hand, 0.0, 20.0))
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert (result.reached_goal, result.stalled) == (False, True)
    assert result.position == pytest.approx(0.015, abs=NEAR_M)
    assert unit.command().hand_force == 20.0
    held = unit.command().hand_commands
    assert ended(send(hand, 0.0))[1].stalled  # already held: the hand gets no command
    assert unit.command().hand_commands == held
    assert ended(send(hand, 0.04))[1].reached_goal


def test_canceling_stops_it_on_its_way(hand: GoalClient, unit: Controller) -> None:
    handle = closing(unit, hand)
    wait_for(handle.cancel_goal_async())
    assert ended(handle)[0] == GoalStatus.STATUS_CANCELED
    wait_until(lambda: unit.command().hand_commands[-1] == "stop", "the stop")
    assert unit.command().width > 0.01
    # A simulation that a busy computer slows down may begin so late that it counts as stalled.
    wait_until(lambda: ended(send(hand, 0.0))[1].reached_goal, "fingers that close after all")


def test_a_stop_of_all_motion_stops_it_until_a_new_command(
    client: Client, hand: GoalClient, unit: Controller
) -> None:
    handle = closing(unit, hand)
    assert client.call(Trigger, "/robotd/stop").success
    assert ended(handle)[0] == GoalStatus.STATUS_ABORTED
    wait_until(lambda: unit.command().hand_commands[-1] == "stop", "the stop")
    assert unit.command().width > 0.01
    assert ended(send(hand, 0.0))[0] == GoalStatus.STATUS_ABORTED  # stopped: no command
    assert client.call(Trigger, "/robotd/reset").success
    assert unit.command().hand_commands[-1] == "stop"
    wait_until(lambda: ended(send(hand, 0.0))[1].reached_goal, "fingers that close after all")


def test_a_new_goal_replaces_the_one_on_its_way(hand: GoalClient, unit: Controller) -> None:
    before = unit.command().hand_commands
    first = closing(unit, hand)
    status, result = ended(send(hand, 0.04))
    assert (status, result.reached_goal) == (GoalStatus.STATUS_SUCCEEDED, True)
    assert ended(first)[0] == GoalStatus.STATUS_ABORTED
    assert unit.command().hand_commands == [*before, "grasp", "stop", "move"]
    assert unit.command().width == pytest.approx(0.08, abs=2 * NEAR_M)


@pytest.mark.parametrize(("position_m", "force_n"), [(0.05, 0.0), (-0.01, 0.0), (0.0, -1.0)])
def test_a_goal_it_cannot_do_is_rejected(
    hand: GoalClient, position_m: float, force_n: float
) -> None:
    goal = GripperCommand.Goal()
    goal.command.position, goal.command.max_effort = position_m, force_n
    assert not wait_for(hand.send_goal_async(goal)).accepted


def test_it_is_homed_on_request_only(client: Client, hand: GoalClient, unit: Controller) -> None:
    before = unit.command(homed=False).hand_commands
    wait_until(lambda: ended(send(hand, 0.0))[0] == GoalStatus.STATUS_ABORTED, "no stroke")
    assert unit.command().hand_commands == before
    response = client.call(Trigger, "/robotd/home_gripper")
    assert (response.success, response.message) == (True, "gripper homed")
    assert unit.command().hand_commands == [*before, "homing"]
    assert ended(send(hand, 0.0))[1].reached_goal
