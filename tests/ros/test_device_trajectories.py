"""Trajectories that the device interpolates, on the stand-in for the WMX engine."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from sensor_msgs.msg import JointState
from tests.ros.robot_process import BACKEND, Client, RobotProcess
from trajectory_msgs.msg import JointTrajectoryPoint

pytestmark = [
    pytest.mark.ros,
    pytest.mark.second_backend,
    pytest.mark.skipif(BACKEND != "wmx", reason="its backend streams"),
]

NAMES = [f"joint{number}" for number in range(1, 7)]
DEVICE_POINTS = 3001  # as many as a goal may have, and its start
STEP_S, SPEED_RAD_S = 0.03, 0.06  # of a path that shakes between its points by 0.45 mrad


class Arm:
    def __init__(self, client: Client) -> None:
        self.client = client
        self._states = client.listen(JointState, "/joint_states")

    def state(self) -> tuple[float, float]:
        """Return the next position and velocity of joint 1."""
        state = self.client.next(self._states)
        return float(state.position[0]), float(state.velocity[0])

    def wait_velocity(self, rad_s: float) -> None:
        self.client.next(self._states, lambda message: abs(message.velocity[0]) > rad_s)

    def send(self, target: float, seconds: float, points: int) -> Any:
        """Send a smooth path to ``target`` with its first point at time 0."""
        start, _ = self.state()
        times_s = np.linspace(0.0, seconds, points)
        u = times_s / seconds
        share = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        positions = start + (target - start) * share
        return self._send(times_s.tolist(), positions.tolist())

    def shake(self, points: int) -> Any:
        """Send a path to and fro: all points are where the joint is, with velocities of ±."""
        start, _ = self.state()
        times_s = [STEP_S * number for number in range(points)]
        velocities = [(-1) ** number * SPEED_RAD_S for number in range(points)]
        velocities[0] = velocities[-1] = 0.0
        return self._send(times_s, [start] * points, velocities)

    def _send(
        self, times_s: list[float], positions: list[float], velocities: list[float] | None = None
    ) -> Any:
        goal = FollowJointTrajectory.Goal()
        goal.trajectory.joint_names = NAMES
        goal.trajectory.points = [
            JointTrajectoryPoint(
                positions=[position] + [0.0] * 5,
                time_from_start=Duration(sec=int(time_s), nanosec=int(time_s % 1 * 1e9)),
            )
            for time_s, position in zip(times_s, positions, strict=True)
        ]
        for point, velocity in zip(goal.trajectory.points, velocities or [], strict=False):
            point.velocities = [velocity] + [0.0] * 5
        return self.client.send_goal(goal)


@pytest.fixture(scope="module")
def arm() -> Iterator[Arm]:
    settings = "backends.wmx.stream_positions=false", "engine.stale_after_s=1.0"
    with RobotProcess(*[word for setting in settings for word in ("--set", setting)]) as process:
        process.wait_ready()
        client = Client(process.domain)
        yield Arm(client)
        client.close()


def test_a_path_of_many_points_is_followed(arm: Arm) -> None:
    status, result = arm.send(0.5, 3.0, points=2500).result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    assert arm.state()[0] == pytest.approx(0.5, abs=5e-3)


def test_a_path_that_needs_more_points_than_the_device_takes_is_rejected(arm: Arm) -> None:
    before, _ = arm.state()
    status, result = arm.shake(2990).result()
    assert status == GoalStatus.STATUS_ABORTED, result.error_string
    assert f"the device takes {DEVICE_POINTS} points" in result.error_string
    assert "or more; split the trajectory" in result.error_string
    assert arm.state()[0] == pytest.approx(before, abs=1e-4)


def test_replanning_in_motion_from_a_first_point_at_time_zero(arm: Arm) -> None:
    """The device stops, and follows the plan from where it has stopped."""
    first = arm.send(1.4, 12.0, points=300)
    arm.wait_velocity(0.03)
    status, result = arm.send(0.7, 3.0, points=300).result()
    assert "preempted" in first.result()[1].error_string
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    assert arm.state()[0] == pytest.approx(0.7, abs=5e-3)
