"""FollowJointTrajectory ↔ core types: pure, and refusing what is not supported."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from typing import Any

from control_msgs.action import FollowJointTrajectory

from robotd.clock import NANOSECONDS, Clock
from robotd.control.sources.trajectory_execution import Progress
from robotd.motion import JointTolerance, TrajectoryRequest
from robotd.motion.rejection import reject
from robotd_ros.trajectory_messages import duration_s

CLOCK_READINGS = 3


def trajectory_request(trajectory: Any) -> TrajectoryRequest:
    """The rows of a trajectory_msgs/JointTrajectory as they came. Raises TrajectoryRejected."""
    points = trajectory.points
    if any(point.effort for point in points):
        raise reject("effort in the points is not supported; leave it empty")
    return TrajectoryRequest.from_rows(
        trajectory.joint_names,
        [duration_s(point.time_from_start) for point in points],
        [point.positions for point in points],
        [point.velocities for point in points],
        [point.accelerations for point in points],
    )


def joint_tolerances(entries: Iterable[Any]) -> list[JointTolerance]:
    """The entries of ``path_tolerance`` or ``goal_tolerance``; 0 and -1 keep their meaning."""
    return [
        JointTolerance(entry.name, entry.position, entry.velocity, entry.acceleration)
        for entry in entries
    ]


def stamp_ns(message: Any) -> int:
    """Nanoseconds of a builtin_interfaces/Time or Duration."""
    return int(message.sec) * NANOSECONDS + int(message.nanosec)


def start_time_ns(trajectory: Any, ros_clock: Any, clock: Clock) -> int | None:
    """Return the time of ``clock`` at which a trajectory begins; None: now (stamp 0)."""
    begin_ns = stamp_ns(trajectory.header.stamp)
    return clock_time_ns(begin_ns, ros_clock, clock) if begin_ns else None


def clock_time_ns(time_ns: int, ros_clock: Any, clock: Clock) -> int:
    """Return the time of ``clock`` at ROS time ``time_ns``. Any thread.

    Uses the best of some readings: a thread may be suspended between the two clocks, and goals of
    several joint groups with one stamp start together.
    """
    readings = []
    for _ in range(CLOCK_READINGS):
        before_ns, ros_ns = clock.now_ns(), int(ros_clock.now().nanoseconds)
        readings.append((clock.now_ns() - before_ns, before_ns + time_ns - ros_ns))
    return min(readings)[1]


class TrajectoryFeedback:
    """Feedback message of one goal, filled anew each time. One thread at a time.

    Args:
        names: (m,) joints of the goal, in the order of the arrays of ``Progress``.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._message = FollowJointTrajectory.Feedback(joint_names=list(names))

    def fill(self, progress: Progress, now_ns: int) -> Any:
        """Return the message with ``progress``, stamped with ROS time ``now_ns``."""
        message = self._message
        _set_time(message.header.stamp, now_ns)
        time_ns = round(max(progress.time_s, 0.0) * NANOSECONDS)
        desired = (progress.desired_position, progress.desired_velocity)
        actual = (progress.actual_position, progress.actual_velocity)
        error = (desired[0] - actual[0], desired[1] - actual[1])
        points = (message.desired, message.actual, message.error)
        for point, (position, velocity) in zip(points, (desired, actual, error), strict=True):
            point.positions = array("d", position.tobytes())
            point.velocities = array("d", velocity.tobytes())
            _set_time(point.time_from_start, time_ns)
        return message


def _set_time(message: Any, time_ns: int) -> None:
    message.sec, message.nanosec = divmod(time_ns, NANOSECONDS)


def refuse_unsupported(goal: Any) -> None:
    """Raise TrajectoryRejected for parts of a goal that cannot be honoured."""
    multi_dof = goal.multi_dof_trajectory
    for given, what in (
        (multi_dof.joint_names or multi_dof.points, "multi_dof_trajectory"),
        (goal.component_path_tolerance, "component_path_tolerance"),
        (goal.component_goal_tolerance, "component_goal_tolerance"),
    ):
        if given:
            raise reject(f"{what} is not supported; leave it empty")
