"""Highest velocity of a jog: from every moment of its motion the stop takes at most the time."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.motion import JointLimits
from robotd.motion.limiter import SetpointLimiter
from robotd.motion.stopping import stoppable_velocity

PERIOD_S = 0.001


def limits(acceleration: float, jerk: float) -> JointLimits:
    return JointLimits(
        ("joint1",), *(np.array([value]) for value in (-9.0, 9.0, 9.0, acceleration)),
        jerk=np.array([jerk]),
    )  # fmt: skip


@pytest.mark.parametrize("within_s", [0.05, 0.09, 0.3, 0.8])
@pytest.mark.parametrize(("acceleration", "jerk"), [(12.0, 240.0), (1.0, 20.0), (5.0, 1000.0)])
def test_the_longest_stop_takes_the_time(acceleration: float, jerk: float, within_s: float) -> None:
    joint = limits(acceleration, jerk)
    velocity = stoppable_velocity(joint.acceleration, joint.jerk, within_s)
    assert velocity > 0.0
    longest = max(
        stop_time(joint, velocity, steps) for steps in range(1, round(within_s / PERIOD_S) + 60, 3)
    )
    assert longest <= within_s + 2 * PERIOD_S
    assert longest >= 0.95 * within_s - 2 * PERIOD_S


def stop_time(joint: JointLimits, velocity: np.ndarray, steps: int) -> float:
    """Time of the stop after ``steps`` periods of motion with ``velocity``."""
    limiter = SetpointLimiter(joint, PERIOD_S)
    limiter.move(velocity)
    for _ in range(steps):
        limiter.step()
    limiter.stop()
    count = 0
    while not limiter.at_rest:
        limiter.step()
        count += 1
    return count * PERIOD_S
