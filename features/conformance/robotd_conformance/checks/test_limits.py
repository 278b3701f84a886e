"""Limits in force: motion that robotd accepts is neither clipped nor rejected by the device."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.api import Capability
from robotd.api.robots import Outcome
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.recorded_motion import judge

SPEED, RAMP = 0.95, 0.8  # shares of the limits
ROOM = 0.8  # share of the distance to the nearer position limit
LAG_S = 0.05  # granted to a joint behind its path
POINTS = 60


@pytest.mark.clause("AxisDriver.device_limits/limits", "AxisDriver.stream/position")
@pytest.mark.needs(Capability.SIMULATED)
@pytest.mark.free_space
def test_a_trajectory_at_the_limits_is_followed(harness: Harness, joints: list[int]) -> None:
    """A device that clips sooner reports its limits: ``AxisDriver.device_limits``."""
    times_s, rows = fastest_motion(harness)
    with harness.recording() as recording:
        execution = harness.follow(times_s, rows, velocities=True)
    harness.rest()
    problems = [] if execution.outcome is Outcome.SUCCEEDED else [execution.message]
    error = np.abs(recording.position - recording.position_command)[:, joints].max(0)
    allowed = harness.pose.tolerance[joints] + LAG_S * harness.robot.follower.limits.velocity
    problems += [
        f"{name}: {error[joint]:.3f} behind the command at {SPEED:.0%} of its velocity limit"
        for joint, name in enumerate(harness.robot.joint_names)
        if error[joint] > allowed[joint]
    ]
    judge(harness, recording, problems)


def fastest_motion(harness: Harness) -> tuple[list[float], list[np.ndarray]]:
    """Return times and rows of a cosine at the limits of each joint."""
    limits = harness.robot.follower.limits
    start = harness.image.position_command[harness.joints]
    up, down = limits.upper - start, start - limits.lower
    speed, ramp = SPEED * limits.velocity, RAMP * limits.acceleration
    travel = np.minimum(2.0 * speed**2 / ramp, ROOM * np.maximum(up, down))
    rate = np.minimum(2.0 * speed / travel, np.sqrt(2.0 * ramp / travel))  # of the phase, rad/s
    travel *= np.where(up >= down, 1.0, -1.0)
    times_s = np.linspace(0.0, 2.0 * np.pi / rate.min(), POINTS + 1)[1:]
    phases = np.minimum(np.outer(times_s, rate), 2.0 * np.pi)
    return times_s.tolist(), list(0.5 * travel * (1.0 - np.cos(phases)))
