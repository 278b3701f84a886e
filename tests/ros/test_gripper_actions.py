"""The gripper's actions, as MoveIt's gripper controllers use them."""

from __future__ import annotations

from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from control_msgs.action import GripperCommand, ParallelGripperCommand
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import WAIT_S, Client, wait_for
from unique_identifier_msgs.msg import UUID
from wmx_ros2_message.srv import GetIoBit

pytestmark = [pytest.mark.daily, pytest.mark.ros]

CLOSED_M = 0.045


def run(client: Client, action_type: Any, name: str, goal: Any) -> tuple[int, Any]:
    actions = GoalClient(client.node, action_type, name)
    assert actions.wait_for_server(WAIT_S)
    handle = wait_for(actions.send_goal_async(goal))
    if not handle.accepted:
        return GoalStatus.STATUS_UNKNOWN, None
    answer = wait_for(handle.get_result_async())
    return answer.status, answer.result


def command(client: Client, position: float) -> tuple[int, Any]:
    goal = GripperCommand.Goal()
    goal.command.position = position
    return run(client, GripperCommand, "/gripper_controller/gripper_cmd", goal)


def output(client: Client) -> bool:
    return bool(client.call(GetIoBit, "/wmx/io/get_output_bit", byte=0, bit=0).value)


def test_the_gripper_closes_and_opens(client: Client) -> None:
    status, result = command(client, CLOSED_M)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert (result.position, result.reached_goal, result.stalled) == (CLOSED_M, True, False)
    assert output(client)
    status, result = command(client, 0.0)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert (result.position, result.reached_goal, result.stalled) == (0.0, True, False)
    assert not output(client)


def test_a_position_in_between_stalls_at_the_nearer_end(client: Client) -> None:
    _, result = command(client, 0.01)
    assert (result.position, result.reached_goal, result.stalled) == (0.0, False, True)


def test_a_position_outside_the_stroke_is_rejected(client: Client) -> None:
    assert command(client, 0.1)[1] is None


def test_all_fingers_close_by_the_parallel_action(client: Client) -> None:
    goal = ParallelGripperCommand.Goal()
    goal.command.name, goal.command.position = ["picker_1_joint"], [CLOSED_M]
    action = "/parallel_gripper_controller/gripper_cmd"
    status, result = run(client, ParallelGripperCommand, action, goal)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert list(result.state.name) == ["picker_1_joint", "picker_2_joint"]
    assert list(result.state.position) == [CLOSED_M, CLOSED_M]
    goal.command.name = ["elbow"]
    assert run(client, ParallelGripperCommand, action, goal)[1] is None
    goal.command.name, goal.command.position = ["picker_1_joint"] * 2, [CLOSED_M, 0.0]
    assert run(client, ParallelGripperCommand, action, goal)[1] is None
    assert command(client, 0.0)[1].reached_goal


def test_goals_of_one_id_do_not_use_up_the_gripper(client: Client) -> None:
    goal = GripperCommand.Goal()
    goal.command.position = 0.0
    actions = GoalClient(client.node, GripperCommand, "/gripper_controller/gripper_cmd")
    assert actions.wait_for_server(WAIT_S)
    identity = UUID(uuid=list(range(16)))
    accepted = [wait_for(actions.send_goal_async(goal, goal_uuid=identity)) for _ in range(12)]
    assert [handle.accepted for handle in accepted] == [True] + [False] * 11
    assert command(client, 0.0)[0] == GoalStatus.STATUS_SUCCEEDED
