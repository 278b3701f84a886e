"""A joint that does not follow: its result in time for MoveIt, and the command's return."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from builtin_interfaces.msg import Duration
from click.testing import CliRunner
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from tests.ros.robot_process import Client, RobotProcess, wait_until
from trajectory_msgs.msg import JointTrajectoryPoint
from wmx_ros2_message.msg import AxisState

from robotd.cli import main

pytestmark = pytest.mark.ros

NAMES = [f"joint{number}" for number in range(1, 7)]
RESULT = FollowJointTrajectory.Result
AXIS = 5
STILL_RAD = 1e-3


class Arm:
    """Served arm on the simulation, whose joint 6 can be blocked."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self._states = client.listen(AxisState, "/wmx/axis/state")

    def state(self) -> tuple[float, float]:
        """Return the next measured position of joint 6 and its command, rad."""
        state = self.client.next(self._states)
        return float(state.actual_pos[AXIS]), float(state.pos_cmd[AXIS])

    def block(self, for_s: float) -> None:
        answer = self.client.inject("following_error", axis=AXIS, for_s=for_s)
        assert answer.success, answer.message

    def send(self, target: float, seconds: int, tolerance: float) -> Any:
        goal = FollowJointTrajectory.Goal()
        goal.trajectory.joint_names = NAMES
        goal.path_tolerance = [JointTolerance(name="joint6", position=tolerance)]
        point = JointTrajectoryPoint(positions=[0.0] * AXIS + [target])
        point.time_from_start = Duration(sec=seconds)
        goal.trajectory.points = [point]
        return self.client.send_goal(goal)


@pytest.fixture(scope="module")
def arm() -> Iterator[Arm]:
    with RobotProcess("--time-scale", "1", backend="sim") as process:  # for its faults
        process.wait_ready()
        client = Client(process.domain)
        yield Arm(client)
        client.close()


def test_the_command_returns_to_a_blocked_joint_which_does_not_move_when_it_is_free(
    arm: Arm,
) -> None:
    arm.block(for_s=4.0)
    before, _ = arm.state()
    result = arm.send(before + 0.6, 3, tolerance=0.15).result()[1]
    assert result.error_code == RESULT.PATH_TOLERANCE_VIOLATED, result.error_string
    measured, command = arm.state()
    assert abs(measured - before) < STILL_RAD, "it was blocked"
    assert abs(command - measured) < 0.01, "the command is back"
    free_s = time.monotonic() + 5.0
    while time.monotonic() < free_s:
        measured, command = arm.state()
        assert abs(measured - before) < 0.01, "it leaps"
    assert abs(command - measured) < STILL_RAD
    status, result = arm.send(before, 1, tolerance=0.0).result()
    assert result.error_code == RESULT.SUCCESSFUL, (status, result.error_string)


def test_the_latest_result_comes_before_moveit_gives_up(arm: Arm) -> None:
    """A joint just off its goal uses ``goal_time_s`` up."""
    exported = CliRunner().invoke(main, ["export", "moveit", "--robot", "cr3a"])
    assert exported.exit_code == 0, exported.output
    rules = yaml.safe_load(exported.stdout)["/**"]["ros__parameters"]["trajectory_execution"]
    margin_s = rules["allowed_goal_duration_margin"]
    start, _ = arm.state()
    begin_s = time.monotonic()
    sent = arm.send(start + 0.5, 2, tolerance=0.4)
    wait_until(lambda: arm.state()[0] > start + 0.4, "near the goal")
    arm.block(for_s=15.0)
    result = sent.result()[1]
    took_s = time.monotonic() - begin_s
    assert result.error_code == RESULT.GOAL_TOLERANCE_VIOLATED, result.error_string
    assert 2.0 + 2.0 <= took_s < 2.0 + margin_s
