"""Paths as planners make them: time-optimal, and sampled."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray


def time_optimal(
    distance: float, velocity: float, acceleration: float, step_s: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Times, positions, velocities and accelerations of a trapezoidal profile, as TOTG's.

    Sampled every ``step_s`` and at the end; the acceleration is ``acceleration`` or 0.
    """
    ramp_s = min(velocity / acceleration, (distance / acceleration) ** 0.5)
    speed = acceleration * ramp_s
    end_s = distance / speed + ramp_s
    times_s = np.append(np.arange(0.0, end_s - 1e-9, step_s), end_s)
    left_s = end_s - times_s
    speeds = np.minimum(np.minimum(acceleration * times_s, acceleration * left_s), speed)
    positions = np.where(
        times_s < ramp_s,
        acceleration * times_s**2 / 2.0,
        np.where(
            left_s < ramp_s,
            distance - acceleration * left_s**2 / 2.0,
            speed * (times_s - ramp_s / 2.0),
        ),
    )
    speeds[-1] = 0.0
    ramps = np.where(left_s < ramp_s, -1.0, np.where(times_s < ramp_s, 1.0, 0.0))
    return times_s, positions, speeds, acceleration * ramps
