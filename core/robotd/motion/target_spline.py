"""Smooth reference through targets that arrive at an unsteady rate, a fixed delay behind them.

The targets are the control points of a uniform quadratic B-spline: position and velocity are
continuous, the acceleration is constant between two targets, and the curve stays within the range
of three neighbouring targets, so that it does not overshoot one that stands still. Its parameter
counts targets and advances at their mean rate of arrival, so that jitter does not reach the curve.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.motion.joint_planner import Row

ARRIVAL_JITTER_SHARE = 0.25  # of an input period: arrivals may be late by that
RATE_WINDOW = 16  # arrivals over which their rate is measured
FIRST_PERIOD_S = 1.0 / 30.0  # assumed until two targets have come
SHORTEST_PERIOD_S = 1e-4
LONGEST_PERIOD_S = 0.2  # targets further apart do not belong to one motion
MAX_QUEUED_TARGETS = 4  # targets; older ones are left out
PHASE_FILTER_GAIN = 0.2  # of an arrival in the mean phase error
PHASE_CORRECTION_SHARE = 0.15  # of the phase error, in an input period
RATES = (0.5, 2.0)  # lowest and highest, relative to the targets'


class TargetSpline:
    """Reference of m joints, 1.5 + ``ARRIVAL_JITTER_SHARE`` input periods late. One thread.

    Args:
        position, velocity: (m,) of the joints now, which the reference continues.
        target: (m,) the first one.
        time_ns: its time of arrival.
    """

    def __init__(
        self, position: FloatArray, velocity: FloatArray, target: FloatArray, time_ns: int
    ) -> None:
        half = 0.5 * FIRST_PERIOD_S * velocity
        self._points: FloatArray = np.array([position - half, position + half, target])
        self._waiting: deque[FloatArray] = deque()
        self._arrivals: deque[int] = deque([time_ns], maxlen=RATE_WINDOW)
        self._period_s = FIRST_PERIOD_S
        self._phase = 0.0  # within the present three points; below 0: waits at its beginning
        self._lag = 0.0  # mean number of input periods behind the intended phase
        self._stands: list[bool] | None = None  # None: has to be found again
        self._padded = False  # the last point repeats the one before: no target came in time

    @property
    def newest(self) -> Row:
        """The last target."""
        newest: Row = (self._waiting[-1] if self._waiting else self._points[-1]).tolist()
        return newest

    @property
    def rests(self) -> list[bool]:
        """Joints whose last or last but one target repeats the one before.

        A joint that has just begun to move may stop at its first target.
        """
        if self._stands is None:
            before, middle, last = [*self._points, *self._waiting][-3:]
            self._stands = ((last == middle) | (middle == before)).tolist()
        return self._stands

    def add(self, target: FloatArray, time_ns: int) -> None:
        """Append a target (m,) that arrived at ``time_ns``."""
        self._measure(time_ns)
        self._stands = None
        if not self._padded:
            self._waiting.append(target)
        elif self._rests():
            self._points[-1], self._phase, self._lag = target, -ARRIVAL_JITTER_SHARE, 0.0
        else:
            self._points[-1] = target
        self._padded = False
        lag = len(self._waiting) - ARRIVAL_JITTER_SHARE - self._phase
        self._lag += PHASE_FILTER_GAIN * (lag - self._lag)
        while len(self._waiting) > MAX_QUEUED_TARGETS:
            self._shift()

    def advance(self, seconds: float) -> FloatArray:
        """Return (3, m) position, velocity and acceleration ``seconds`` later."""
        slowest, fastest = RATES
        rate = min(max(1.0 + PHASE_CORRECTION_SHARE * self._lag, slowest), fastest) / self._period_s
        self._phase += seconds * rate
        while self._phase >= 1.0:
            self._phase -= 1.0
            self._shift()
        u = max(self._phase, 0.0)
        basis = np.array(
            [
                [0.5 * (1.0 - u) ** 2, 0.5 + u - u**2, 0.5 * u**2],
                [(u - 1.0) * rate, (1.0 - 2.0 * u) * rate, u * rate],
                [rate**2, -2.0 * rate**2, rate**2],
            ]
        )
        reference: FloatArray = basis.dot(self._points)
        return reference

    def _measure(self, time_ns: int) -> None:
        """Update the mean period of arrivals."""
        if time_ns - self._arrivals[-1] > LONGEST_PERIOD_S * NANOSECONDS:
            self._arrivals.clear()
        self._arrivals.append(time_ns)
        if (gaps := len(self._arrivals) - 1) > 0:
            span_s = (time_ns - self._arrivals[0]) / NANOSECONDS
            self._period_s = max(span_s / gaps, SHORTEST_PERIOD_S)

    def _rests(self) -> bool:
        first, second, third = self._points
        return bool((first == second).all() and (second == third).all())

    def _shift(self) -> None:
        """Go on to the next point; without one, to the last again."""
        self._padded = not self._waiting
        following = self._waiting.popleft() if self._waiting else self._points[-1].copy()
        self._points[:-1] = self._points[1:]
        self._points[-1] = following
        self._stands = None
