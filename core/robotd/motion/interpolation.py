"""Polynomials through knots; the kind follows from the values that the client gave.

All kinds share one form: coefficients of shape (k, order, m), highest power first, of the
time since the start of the segment.
"""

from __future__ import annotations

from enum import Enum

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.rejection import reject
from robotd.motion.request import TrajectoryRequest

_MAX_COEFFICIENT = 1e100  # products with powers of the time stay finite


class Interpolation(Enum):
    """Kind of path between knots, and what is continuous at them."""

    CUBIC_SPLINE = "cubic spline"  # positions given; acceleration too is continuous
    CUBIC_HERMITE = "cubic Hermite"  # and velocities given; velocity is continuous
    QUINTIC_HERMITE = "quintic Hermite"  # and accelerations given; acceleration is continuous
    BLENDED = "blended"  # one of these with a dwell, or with a start deviation blended in


def interpolate(
    knots: TrajectoryRequest, start_velocity: FloatArray
) -> tuple[Interpolation, FloatArray]:
    """Return the path through k + 1 knots that uses all that is given.

    That is its kind, and coefficients (k, order, m).

    ``start_velocity`` (m,) is that at the first knot where the knots have no velocities.

    Raises TrajectoryRejected: the numbers are too large to compute with.
    """
    times_s, positions = knots.times_s, knots.positions
    with np.errstate(all="ignore"):
        if knots.velocities is None:
            kind = Interpolation.CUBIC_SPLINE
            velocities = spline_velocities(times_s, positions, start_velocity)
            coefficients = _cubic(times_s, positions, velocities)
        elif knots.accelerations is None:
            kind = Interpolation.CUBIC_HERMITE
            coefficients = _cubic(times_s, positions, knots.velocities)
        else:
            kind = Interpolation.QUINTIC_HERMITE
            coefficients = quintic(times_s, positions, knots.velocities, knots.accelerations)
    if not (np.abs(coefficients) < _MAX_COEFFICIENT).all():
        raise reject("the points are too far apart to be joined by a finite path")
    return kind, coefficients


def clamped_spline(times_s: FloatArray, positions: FloatArray) -> FloatArray:
    """Return coefficients (k, 4, m) of the cubic spline at rest at both ends."""
    rest = np.zeros(positions.shape[1])
    return _cubic(times_s, positions, spline_velocities(times_s, positions, rest))


def spline_velocities(
    times_s: FloatArray, positions: FloatArray, start_velocity: FloatArray
) -> FloatArray:
    """Return (k + 1, m) velocities of the cubic spline from ``start_velocity`` to standstill.

    With segment lengths h and slopes s, equal second derivatives at the inner knots say

        h[i]·v[i-1] + 2·(h[i-1] + h[i])·v[i] + h[i-1]·v[i+1] = 3·(h[i]·s[i-1] + h[i-1]·s[i]).

    The matrix is tridiagonal and diagonally dominant, so elimination needs no pivots.
    """
    h = np.diff(times_s)
    slope = np.diff(positions, axis=0) / h[:, None]
    velocity = np.zeros_like(positions)
    velocity[0] = start_velocity
    velocity[1:-1] = 3.0 * (h[1:, None] * slope[:-1] + h[:-1, None] * slope[1:])
    lengths = h.tolist()
    upper = [0.0]  # what is left of the coefficient of v[i+1] when v[i] has the factor 1
    for i in range(1, len(lengths)):
        before, after = lengths[i - 1], lengths[i]
        pivot = 2.0 * (before + after) - after * upper[-1]
        upper.append(before / pivot)
        velocity[i] = (velocity[i] - after * velocity[i - 1]) / pivot
    for i in range(len(lengths) - 1, 0, -1):
        velocity[i] -= upper[i] * velocity[i + 1]
    return velocity


def _cubic(times_s: FloatArray, position: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return (k, 4, m): cubics with the given values and derivatives at both their ends."""
    h = np.diff(times_s)[:, None]
    slope = np.diff(position, axis=0) / h
    start, end = velocity[:-1], velocity[1:]
    return np.stack(
        [
            (start + end - 2.0 * slope) / h**2,
            (3.0 * slope - 2.0 * start - end) / h,
            start,
            position[:-1],
        ],
        axis=1,
    )


def quintic(
    times_s: FloatArray, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Return (k, 6, m): quintics with the given values and two derivatives at both ends.

    In τ = t/h the powers 0 to 2 are fixed by the left
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
    return np.stack(
        [c5 / h**5, c4 / h**4, c3 / h**3, acceleration[:-1] / 2.0, velocity[:-1], c0], axis=1
    )
