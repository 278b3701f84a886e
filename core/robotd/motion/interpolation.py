"""From knots to polynomials. Which kind follows from what the client gave.

All kinds share one form: coefficients of shape (k, order, m), highest power first, of the
time since the start of the segment (the layout of ``scipy.interpolate.PPoly``, segment first).
"""

from __future__ import annotations

from enum import Enum

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.joints import MotionState
from robotd.motion.refusal import refuse
from robotd.motion.request import Points


class Interpolation(Enum):
    """How the path runs between its knots, and what is continuous at them."""

    CUBIC_SPLINE = "cubic spline"  # positions given; acceleration too is continuous
    CUBIC_HERMITE = "cubic Hermite"  # and velocities given; velocity is continuous
    QUINTIC_HERMITE = "quintic Hermite"  # and accelerations given; acceleration is continuous


def interpolation_of(knots: Points) -> Interpolation:
    """The kind that uses all that is given."""
    if knots.velocities is None:
        return Interpolation.CUBIC_SPLINE
    if knots.accelerations is None:
        return Interpolation.CUBIC_HERMITE
    return Interpolation.QUINTIC_HERMITE


def interpolate(knots: Points, start: MotionState) -> FloatArray:
    """Coefficients (k, order, m) of a path through the k + 1 knots; it ends at standstill.

    Raises TrajectoryRefused when the numbers are too large to compute with.
    """
    # A third of a second to import: ``preload`` pays it when nobody waits for a joint state.
    from scipy.interpolate import CubicHermiteSpline, CubicSpline

    with np.errstate(all="ignore"):
        if knots.velocities is None:
            at_rest = np.zeros_like(start.velocity)
            stacked = CubicSpline(
                knots.times_s, knots.positions, bc_type=((1, start.velocity), (1, at_rest))
            ).c
        elif knots.accelerations is None:
            stacked = CubicHermiteSpline(knots.times_s, knots.positions, knots.velocities).c
        else:
            stacked = _quintic(
                knots.times_s, knots.positions, knots.velocities, knots.accelerations
            )
    if not np.isfinite(stacked).all():
        raise refuse("the points are too far apart to be joined by a finite path")
    return np.ascontiguousarray(stacked.transpose(1, 0, 2))


def preload() -> None:
    """Import what the first trajectory needs, so that it is planned as fast as the second."""
    import scipy.interpolate  # noqa: F401


def _quintic(
    times_s: FloatArray, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """(6, k, m) from values and two derivatives at both ends of every segment.

    ``BPoly.from_derivatives`` gives the same, one segment at a time in Python, and would hold
    the interpreter for 0.1 s at 1000 points. In τ = t/h the powers 0 to 2 are fixed by the left
    end; the rest a, b, c of the right end's position, velocity and acceleration solve
    [[1, 1, 1], [3, 4, 5], [6, 12, 20]] · (c3, c4, c5) = (a, b, c).
    """
    h = np.diff(times_s)[:, None]
    c0, c1, c2 = position[:-1], velocity[:-1] * h, acceleration[:-1] * h**2 / 2.0
    a = position[1:] - c0 - c1 - c2
    b = velocity[1:] * h - c1 - 2.0 * c2
    c = acceleration[1:] * h**2 - 2.0 * c2
    c3 = 10.0 * a - 4.0 * b + 0.5 * c
    c4 = -15.0 * a + 7.0 * b - c
    c5 = 6.0 * a - 3.0 * b + 0.5 * c
    return np.stack([c5 / h**5, c4 / h**4, c3 / h**3, acceleration[:-1] / 2.0, velocity[:-1], c0])
