"""Planned trajectory, and the sampler that reads it in the control loop."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.interpolation import Interpolation
from robotd.motion.joints import MotionState


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Path over time that ends at standstill. Immutable; any thread may read it.

    Attributes:
        names: the m joints, in axis order.
        kind: of the path between the knots.
        breaks: (k + 1,) times of the knots in s, from 0 to the duration.
        coefficients: (k, order, m), highest power first, of the time since the knot.
        final_position: (m,) where it ends, rad or m.
        goal_s: time of the goal's last point, where it has a velocity and a run-out to rest
            follows; None: the trajectory ends there.
        notes: sentences for the result's text: values that were ignored, points that were
            merged, accelerations above the limit.
    """

    names: tuple[str, ...]
    kind: Interpolation
    breaks: FloatArray
    coefficients: FloatArray
    final_position: FloatArray
    goal_s: float | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for array in (self.breaks, self.coefficients, self.final_position):
            array.flags.writeable = False

    @cached_property
    def duration_s(self) -> float:
        """Return the time of the last knot."""
        return float(self.breaks[-1])

    @property
    def knot_positions(self) -> FloatArray:
        """Return (k + 1, m) positions at ``breaks``."""
        return np.vstack([self.coefficients[:, -1, :], self.final_position])

    def evaluate(self, times_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position, velocity and acceleration at ``times_s`` (n,), each (n, m).

        Times are clamped to the duration; velocity and acceleration are 0 from its end on.
        """
        segment = np.searchsorted(self.breaks, times_s, "right") - 1
        segment = np.minimum(np.maximum(segment, 0), len(self.coefficients) - 1)
        within_s = np.minimum(np.maximum(times_s, 0.0), self.duration_s)  # clip() takes longer
        since_knot = (within_s - self.breaks[segment])[:, None]
        pieces = self.coefficients[segment]
        position, velocity, half_acceleration = np.zeros((3, len(times_s), len(self.names)))
        for power in range(pieces.shape[1]):
            half_acceleration = half_acceleration * since_knot + velocity
            velocity = velocity * since_knot + position
            position = position * since_knot + pieces[:, power]
        over = times_s >= self.duration_s
        position[over], velocity[over], half_acceleration[over] = self.final_position, 0.0, 0.0
        return position, velocity, 2.0 * half_acceleration

    def state_at(self, time_s: float) -> MotionState:
        """Return the commanded state at ``time_s``, from which a successor is planned."""
        position, velocity, acceleration = self.evaluate(np.array([time_s]))
        return MotionState(position[0], velocity[0], acceleration[0])


class Sampler:
    """Reader of one trajectory, period by period. One owner thread; ``sample`` allocates no array.

    One product per sample: the powers of the time since the knot, times a matrix that holds
    the coefficients of position, velocity and acceleration side by side.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        segments, order, joints = trajectory.coefficients.shape
        factors = np.arange(order - 1, 0, -1.0)[:, None]
        wide = np.zeros((segments, order, 3, joints))
        wide[:, :, 0] = trajectory.coefficients
        for derivative in (1, 2):
            wide[:, 1:, derivative] = wide[:, :-1, derivative - 1] * factors
        self.trajectory = trajectory
        self._segments = list(wide.reshape(segments, order, 3 * joints))
        self._breaks: list[float] = trajectory.breaks.tolist()
        self._end_s = trajectory.duration_s
        self._segment = 0
        self._powers = np.zeros(order)
        self._descending = tuple(range(order - 1, -1, -1))
        self._out = np.zeros(3 * joints)
        self._motion = self._out.reshape(3, joints)

    def sample(self, time_s: float, out: FloatArray) -> None:
        """Write position, velocity and acceleration at ``time_s`` into ``out`` (3, m).

        Times before 0 give the start, times from the duration on the rest position. Going
        forward from period to period costs least; any other order is right too.
        """
        if time_s >= self._end_s:
            out[0] = self.trajectory.final_position
            out[1:] = 0.0
            return
        breaks, segment, powers = self._breaks, self._segment, self._powers
        time_s = max(time_s, 0.0)
        if not breaks[segment] <= time_s < breaks[segment + 1]:
            segment = self._segment = bisect_right(breaks, time_s) - 1
        since_knot = time_s - breaks[segment]
        power = 1.0
        for index in self._descending:
            powers[index] = power
            power *= since_knot
        powers.dot(self._segments[segment], self._out)
        out[:] = self._motion
