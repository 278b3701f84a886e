"""Smooth reference through windows of points; each replaces the rest of the one before.

A message of a client such as MoveIt Servo has the points of the near past and future, and the next
one repeats most of them. Their times jitter with the client, and where the motion begins and ends
the velocity jumps. The reference is the curve through the points, averaged over ``± WIDTH_S`` with
a triangular weight: its acceleration is continuous, and it has no lag, because the points are known
that long ahead. Where they are not, the motion continues with the last velocity.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.motion.joint_planner import Row

WIDTH_S = 0.06
RETAINED_PAST_S = 2.0 * WIDTH_S  # of the points that are kept before those of a new window
CATCH_UP_FACTOR = 1.15  # than the points, for the return to the reference
CATCH_UP_GAIN_PER_S = 2.0  # velocity of the return for each rad or m of deviation
MIN_CATCH_UP_SHARE = 0.005  # of the velocity limit: always allowed for the return


class SlidingWindow:
    """Reference of m joints along the points of windows. One thread.

    Before the first point and after the last one it has their velocities.

    Args:
        times_ns: (n,) increasing.
        position: (n, m) rad or m.
        velocity: (n, m) at the points.

    Attributes:
        rests: joints that come to rest at the last two points, and do not overshoot them.
    """

    def __init__(self, times_ns: Sequence[int], position: FloatArray, velocity: FloatArray) -> None:
        self._set(list(times_ns), position, velocity)

    @property
    def newest(self) -> Row:
        """The last position."""
        newest: Row = self._position[-1].tolist()
        return newest

    def replace(self, times_ns: Sequence[int], position: FloatArray, velocity: FloatArray) -> None:
        """Replace the points from the first of ``times_ns`` on; arguments: those of the class."""
        begin = bisect_right(self._times_ns, times_ns[0] - round(RETAINED_PAST_S * NANOSECONDS))
        end = bisect_right(self._times_ns, times_ns[0] - 1)
        self._set(
            [*self._times_ns[begin:end], *times_ns],
            np.concatenate([self._position[begin:end], position]),
            np.concatenate([self._velocity[begin:end], velocity]),
        )

    def at(self, time_ns: int) -> FloatArray:
        """Return (3, m) position, velocity and acceleration."""
        seconds = (time_ns - self._times_ns[0]) / NANOSECONDS
        before, now, after = (
            self._integrals(seconds + shift) for shift in (-WIDTH_S, 0.0, WIDTH_S)
        )
        reference: FloatArray = (before - 2.0 * now + after) / WIDTH_S**2
        reference[0] += self._position[0]
        return reference

    def velocity_range(
        self, reference: FloatArray, position: FloatArray, limit: FloatArray
    ) -> tuple[Row, Row]:
        """Return the lowest and highest velocity of joints at ``position`` near ``reference``.

        They are little more than those of the points, so that no joint catches up fast.
        """
        back = CATCH_UP_GAIN_PER_S * np.abs(position - reference[0]) + MIN_CATCH_UP_SHARE * limit
        # NaN of joints without points: slowed to rest, within their limits.
        back = np.where(np.isnan(back), limit, back)
        forward = CATCH_UP_FACTOR * np.fmax(self._highest, reference[1])
        backward = CATCH_UP_FACTOR * np.fmax(self._lowest, -reference[1])
        highest = np.minimum(np.fmax(forward, back), limit)
        lowest = -np.minimum(np.fmax(backward, back), limit)
        return lowest.tolist(), highest.tolist()

    def _set(self, times_ns: list[int], position: FloatArray, velocity: FloatArray) -> None:
        """Compute the second integral of the curve, a polynomial for each segment."""
        self._times_ns, self._position, self._velocity = times_ns, position, velocity
        self._highest = np.maximum(velocity.max(axis=0), 0.0)
        self._lowest = np.maximum(-velocity.min(axis=0), 0.0)
        differs = position != position[-1]
        ends = ~differs[-2:].any(axis=0) & (velocity[-1] == 0.0)
        self.rests: list[bool] = (ends & differs.any(axis=0)).tolist()
        count, joints = position.shape
        times = (np.array(times_ns) - times_ns[0]) / NANOSECONDS
        self._times: list[float] = times.tolist()
        h = np.diff(times)[:, None]
        p, v = position - position[0], velocity
        step, change = np.diff(p, axis=0), v[:-1] + v[1:]
        # By powers of the time in the segment: first of the curve (a cubic, or straight before
        # the first point and after the last), then twice integrated.
        curve = np.zeros((count + 1, 4, joints))
        curve[1:, 0], curve[0, 0] = p, p[0]
        curve[1:, 1], curve[0, 1] = v, v[0]
        curve[1:-1, 2] = (3.0 * step / h - change - v[:-1]) / h
        curve[1:-1, 3] = (change - 2.0 * step / h) / h**2
        self._polynomials = np.zeros((count + 1, 6, joints))
        self._polynomials[:, 2:] = curve / np.array([2.0, 6.0, 12.0, 20.0])[:, None]
        c0, c1, c2, c3 = curve[1:-1].swapaxes(0, 1)
        once = h * (c0 + h * (c1 / 2.0 + h * (c2 / 3.0 + h * c3 / 4.0)))
        self._polynomials[2:, 1] = np.cumsum(once, axis=0)
        twice = h * h * (c0 / 2.0 + h * (c1 / 6.0 + h * (c2 / 12.0 + h * c3 / 20.0)))
        twice += h * self._polynomials[1:-1, 1]
        self._polynomials[2:, 0] = np.cumsum(twice, axis=0)

    def _integrals(self, seconds: float) -> FloatArray:
        """Return (3, m) second and first integral and value of the curve at ``seconds``."""
        index = bisect_right(self._times, seconds)
        begin = self._times[max(index - 1, 0)]
        integrals: FloatArray = _powers(seconds - begin).dot(self._polynomials[index])
        return integrals


def _powers(s: float) -> FloatArray:
    """Return the powers 0 to 5 of ``s``, and their first and second derivatives."""
    s2, s3, s4 = s * s, s**3, s**4
    return np.array(
        [
            [1.0, s, s2, s3, s4, s * s4],
            [0.0, 1.0, 2.0 * s, 3.0 * s2, 4.0 * s3, 5.0 * s4],
            [0.0, 0.0, 2.0, 6.0 * s, 12.0 * s2, 20.0 * s3],
        ]
    )
