"""Exact extreme values of a piecewise polynomial, without sampling."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray

from robotd.arrays import FloatArray

# At which the search stops: relative to the value, absolute below 1.
_PRECISION = 1e-9
# The hull of a half is four times closer to its curve, so 4**-26 covers any double.
_MAX_HALVINGS = 26


@dataclass(frozen=True, eq=False)
class Extreme:
    """Extreme value (m,) of each joint and its time in s (m,)."""

    value: FloatArray
    time_s: FloatArray


def derivative(coefficients: FloatArray) -> FloatArray:
    """Return the derivative of coefficients (k, order, m), one order lower."""
    return coefficients[:, :-1] * np.arange(coefficients.shape[1] - 1, 0, -1.0)[:, None]


def extremes(breaks: FloatArray, coefficients: FloatArray) -> tuple[Extreme, Extreme]:
    """Return minimum and maximum of coefficients (k, order, m) over ``breaks`` (k + 1,).

    Branch and bound: a polynomial lies in the hull of its Bernstein coefficients (Farouki
    and Rajan, 1987), so a segment whose hull stays under the best value found so far is
    done; the few others are halved (de Casteljau) until their hulls are tight. No root is
    computed, so vanishing leading coefficients need no special case. All segments and
    joints at once, the minimum as the maximum of the negative.
    """
    control = _bernstein(breaks, coefficients)
    value, time_s = _maxima(breaks, np.concatenate([-control, control], axis=2))
    joints = coefficients.shape[2]
    return Extreme(-value[:joints], time_s[:joints]), Extreme(value[joints:], time_s[joints:])


@dataclass(frozen=True, eq=False)
class PathPeaks:
    """Extremes of a path per joint, with their times; exact to 1e-9, SI units.

    Attributes:
        lowest, highest: positions.
        velocity, acceleration: largest magnitudes.
    """

    lowest: Extreme
    highest: Extreme
    velocity: Extreme
    acceleration: Extreme

    @classmethod
    def of(cls, breaks: FloatArray, coefficients: FloatArray) -> PathPeaks:
        """Find the extremes of ``coefficients`` (k, order, m) over ``breaks`` (k + 1,)."""
        velocity = derivative(coefficients)
        lowest, highest = extremes(breaks, coefficients)
        return cls(
            lowest,
            highest,
            _magnitude(breaks, velocity),
            _magnitude(breaks, derivative(velocity)),
        )


def _magnitude(breaks: FloatArray, coefficients: FloatArray) -> Extreme:
    lowest, highest = extremes(breaks, coefficients)
    positive = highest.value >= -lowest.value
    return Extreme(
        np.where(positive, highest.value, -lowest.value),
        np.where(positive, highest.time_s, lowest.time_s),
    )


def _maxima(breaks: FloatArray, control: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the maximum over time of each signal of ``control`` (order, k, signals)."""
    best, best_time = _best_at_ends(breaks, control)
    left, right = _halving(control.shape[0])
    segment, signal = np.nonzero(_promising(control, best))
    control = control[:, segment, signal]
    begin, width = breaks[segment], np.diff(breaks)[segment]
    for _ in range(_MAX_HALVINGS):
        if not len(signal):
            break
        width = width / 2.0
        halves = left @ control, right @ control
        _improve(best, best_time, signal, halves[1][0], begin + width)
        control = np.concatenate(halves, axis=1)
        signal = np.concatenate([signal, signal])
        begin, width = np.concatenate([begin, begin + width]), np.concatenate([width, width])
        keep = _promising(control, best[signal])
        control, signal, begin, width = control[:, keep], signal[keep], begin[keep], width[keep]
    return best, best_time


def _promising(control: FloatArray, best: FloatArray) -> NDArray[np.bool_]:
    """Return True for hulls that allow a value above ``best`` by more than the precision."""
    promising: NDArray[np.bool_] = control.max(axis=0) > best + _PRECISION * np.maximum(
        1.0, np.abs(best)
    )
    return promising


def _best_at_ends(breaks: FloatArray, control: FloatArray) -> tuple[FloatArray, FloatArray]:
    ends = np.concatenate([control[0], control[-1]])
    row = ends.argmax(axis=0)
    times = np.concatenate([breaks[:-1], breaks[1:]])
    return ends[row, np.arange(ends.shape[1])], times[row]


def _improve(
    best: FloatArray,
    best_time: FloatArray,
    signal: NDArray[np.intp],
    value: FloatArray,
    time_s: FloatArray,
) -> None:
    better = value > best[signal]
    signal, value, time_s = signal[better], value[better], time_s[better]
    np.maximum.at(best, signal, value)
    won = value == best[signal]
    best_time[signal[won]] = time_s[won]


def _bernstein(breaks: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Return Bernstein coefficients (order, k, m) of every segment over its own width."""
    order = coefficients.shape[1]
    width = np.diff(breaks)[:, None] ** np.arange(order - 1, -1, -1.0)
    control: FloatArray = _to_bernstein(order) @ (coefficients * width[:, :, None])
    return control.transpose(1, 0, 2)


@cache
def _to_bernstein(order: int) -> FloatArray:
    """Return the matrix (order, order) from power to Bernstein coefficients.

    b_i = Σ_{j ≤ i} C(i, j) / C(n, j) · a_j; a_n is in column 0.
    """
    n = order - 1
    return np.array([[comb(i, n - c) / comb(n, n - c) for c in range(order)] for i in range(order)])


@cache
def _halving(order: int) -> tuple[FloatArray, FloatArray]:
    """Return de Casteljau's algorithm at one half, as matrices for the left and the right."""
    left = np.array([[comb(i, j) / 2.0**i for j in range(order)] for i in range(order)])
    return left, left[::-1, ::-1].copy()
