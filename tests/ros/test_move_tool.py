"""Motion of the tool over ROS: the action, the kinematics, the commands."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, PoseStamped
from robotd_msgs.action import MoveTool
from robotd_msgs.srv import ComputeFk, ComputeIk
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import LATCHED, Client, RobotProcess, wait_for, wait_until
from tests.ros.test_client_commands import robotd
from tests.ros.test_trajectory import goal

pytestmark = pytest.mark.ros

BENT = [0.0, 0.3, 1.4, -0.2, 1.2, 0.0]


@pytest.fixture(autouse=True)
def bent(client: Client) -> Iterator[None]:
    assert client.send_goal(goal((3.0, BENT))).result()[0] == GoalStatus.STATUS_SUCCEEDED
    yield
    assert client.send_goal(goal((3.0, [0.0] * 6))).result()[0] == GoalStatus.STATUS_SUCCEEDED


@pytest.fixture(scope="module")
def action(client: Client) -> GoalClient:
    return GoalClient(client.node, MoveTool, "/robotd/move_tool")


def displacement(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Pose:
    return Pose(position=Point(x=x, y=y, z=z))


def send(action: GoalClient, **fields: Any) -> tuple[int, Any, list[Any]]:
    """Status, result and feedback of a goal along the axes of the base."""
    wait_until(action.server_is_ready, "no action")
    feedback: list[Any] = []
    message = MoveTool.Goal(frame=MoveTool.Goal.RELATIVE_BASE, **fields)
    handle = wait_for(
        action.send_goal_async(message, lambda message: feedback.append(message.feedback))
    )
    answer = wait_for(handle.get_result_async())
    return answer.status, answer.result, feedback


def place(client: Client) -> Point:
    answer = client.call(ComputeFk, "/robotd/compute_fk")
    assert answer.success, answer.message
    return answer.pose_stamped.pose.position


def place_at_rest(client: Client) -> Point:
    """Wait until the drives, which settle by fractions of a micrometre, have done so."""
    places = [place(client)]

    def is_settled() -> bool:
        time.sleep(0.1)
        places.append(place(client))
        return places[-1] == places[-2]

    wait_until(is_settled, "the drives have settled")
    return places[-1]


def test_a_line_is_driven_and_reported(client: Client, action: GoalClient) -> None:
    before = place(client)
    status, result, feedback = send(action, poses=[displacement(y=0.1, z=0.05)], line=True)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert result.success, result.message
    assert result.deviation_m < 1e-4
    after = place(client)
    assert [after.x, after.y, after.z] == pytest.approx(
        [before.x, before.y + 0.1, before.z + 0.05], abs=1e-3
    )
    # The result may come before the last message of another topic.
    wait_until(lambda: feedback[-1].progress == 1.0, "the end is reported")
    for message in feedback:  # within the following error of the drives
        part = (message.pose.position.y - before.y) / 0.1
        assert message.pose.position.z - before.z == pytest.approx(0.05 * part, abs=1e-3)


def test_what_cannot_be_is_aborted_with_the_place(client: Client, action: GoalClient) -> None:
    before = place_at_rest(client)
    status, result, _ = send(action, poses=[displacement(z=0.6)], line=True)
    assert status == GoalStatus.STATUS_ABORTED
    assert result.message == "at 28 % joint3 cannot follow the line: the arm is singular"
    assert place(client) == before
    status, result, _ = send(action, poses=[displacement(z=0.01)], line=True, plan_only=True)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert "nothing moved" in result.message
    assert place(client) == before
    status, result, _ = send(action, poses=[displacement(z=float("nan"))], line=True)
    assert "not finite" in result.message
    status, result, _ = send(action, poses=[displacement(z=0.01)], line=True, speed=2.0)
    assert result.message.startswith("speed is 2, must be 0.01 to 1")


def test_kinematics_as_services(client: Client) -> None:
    answer = client.call(
        ComputeFk,
        "/robotd/compute_fk",
        joint_state=JointState(name=["joint1"], position=[0.5]),
    )
    assert answer.pose_stamped.header.frame_id == "base_link"
    solved = client.call(
        ComputeIk, "/robotd/compute_ik", pose_stamped=PoseStamped(pose=answer.pose_stamped.pose)
    )
    assert solved.success, solved.message
    (solution,) = solved.solutions
    assert solution.position[0] == pytest.approx(0.5, abs=1e-3)
    far = client.call(
        ComputeIk, "/robotd/compute_ik", pose_stamped=PoseStamped(pose=displacement(x=3.0))
    )
    assert not far.success
    assert far.message.startswith("out of reach: the tool comes within")


def test_the_commands_move_the_tool_and_show_it(cr3a: RobotProcess, client: Client) -> None:
    before = place(client)
    status, output, error = robotd(cr3a.domain, "move", "--tool", "z+0.03", "--line")
    assert status == 0, error
    assert "goal reached" in output
    assert place(client).z == pytest.approx(before.z + 0.03, abs=1e-3)
    status, output, _ = robotd(cr3a.domain, "tool")
    assert status == 0
    assert "link6 in base_link:" in output
    status, output, error = robotd(cr3a.domain, "ik", f"z={before.z:.4f}")
    assert status == 0, error
    assert "joint2=" in output
    status, _, error = robotd(cr3a.domain, "tool", "set", "tip")
    assert status != 0
    assert "unknown tool 'tip' (available: none)" in error


def test_reduced_speed_is_switched_and_shown(cr3a: RobotProcess, client: Client) -> None:
    states = client.listen(Bool, "/robotd/reduced_speed", LATCHED)
    wait_until(lambda: states and not states[-1].data, "it is off at the start")
    status, output, error = robotd(cr3a.domain, "tool", "reduced", "on")
    assert status == 0, error
    assert output == "reduced speed: links and tool move with at most 0.25 m/s\n"
    wait_until(lambda: states[-1].data, "the topic shows that it is on")
    try:
        status, output, _ = robotd(cr3a.domain, "status")
        assert status == 0
        assert "For full speed: robotd tool reduced off" in output
        assert "ready" in output
    finally:
        status, output, _ = robotd(cr3a.domain, "tool", "reduced", "off")
    assert (status, output) == (0, "reduced speed is off\n")
    wait_until(lambda: not states[-1].data, "the topic shows that it is off")
