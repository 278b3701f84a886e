"""Trajectory messages, as nodes and clients write and read them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from builtin_interfaces.msg import Duration
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robotd.clock import NANOSECONDS

Rows = Sequence[Sequence[float]]


def trajectory_of(
    joints: Sequence[str], times_s: Sequence[float], positions: Rows, velocities: Rows | None = None
) -> JointTrajectory:
    """Return a message.

    Args:
        joints: (n,) names.
        times_s: (k,) from the start.
        positions: (k, n), rad or m.
        velocities: (k, n), rad/s or m/s; None: without.
    """
    rows = zip(times_s, positions, velocities or [[]] * len(positions), strict=True)
    points = [
        JointTrajectoryPoint(
            positions=position, velocities=velocity, time_from_start=_duration(time_s)
        )
        for time_s, position, velocity in rows
    ]
    return JointTrajectory(joint_names=[*joints], points=points)


def duration_s(message: Any) -> float:
    """Seconds of a builtin_interfaces/Duration."""
    return float(message.sec + message.nanosec / NANOSECONDS)


def _duration(seconds: float) -> Duration:
    whole, nanoseconds = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return Duration(sec=whole, nanosec=nanoseconds)
