"""A planned trajectory, and the sampler that reads it in the cycle."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.interpolation import Interpolation
from robotd.motion.joints import MotionState
from robotd.motion.peaks import PathPeaks


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A path over time that ends at standstill. Immutable; any thread may read it.

    Attributes:
        names: the m joints, in axis order.
        kind: how the knots are joined.
        breaks: (k + 1,) times of the knots in s, from 0 to the duration.
        coefficients: (k, order, m), highest power first, of the time since the knot.
        final_position: (m,) where it ends, rad or m.
        peaks: how far and how fast every joint gets.
        notes: sentences on what was adjusted or stands out; nothing that forbids moving.
    """

    names: tuple[str, ...]
    kind: Interpolation
    breaks: FloatArray
    coefficients: FloatArray
    final_position: FloatArray
    peaks: PathPeaks
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for array in (self.breaks, self.coefficients, self.final_position):
            array.flags.writeable = False

    @property
    def duration_s(self) -> float:
        """Time of the last knot."""
        return float(self.breaks[-1])

    @property
    def knot_positions(self) -> FloatArray:
        """(k + 1, m) positions at ``breaks``, for a device that interpolates by itself."""
        return np.vstack([self.coefficients[:, -1, :], self.final_position])

    def evaluate(self, times_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity and acceleration at ``times_s`` (n,), each (n, m).

        Times are clamped to the duration; velocity and acceleration are 0 from its end on.
        """
        segment = np.clip(
            np.searchsorted(self.breaks, times_s, "right") - 1, 0, len(self.coefficients) - 1
        )
        since_knot = (np.clip(times_s, 0.0, self.duration_s) - self.breaks[segment])[:, None]
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
        """The commanded state at ``time_s``: where a trajectory that replaces this one begins."""
        position, velocity, acceleration = self.evaluate(np.array([time_s]))
        return MotionState(position[0], velocity[0], acceleration[0])


class Sampler:
    """Reads one trajectory period by period. One owner thread; ``sample`` does not allocate arrays.

    One product per sample: the powers of the time since the knot, times a matrix that holds
    the coefficients of position, velocity and acceleration side by side.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        segments, order, joints = trajectory.coefficients.shape
        factors = np.arange(order - 1, 0, -1.0)[:, None]
        wide = np.zeros((segments, order, 3 * joints))
        wide[:, :, :joints] = trajectory.coefficients
        for column in (joints, 2 * joints):
            wide[:, 1:, column : column + joints] = wide[:, :-1, column - joints : column] * factors
        self.trajectory = trajectory
        self._segments = list(wide)
        self._breaks: list[float] = trajectory.breaks.tolist()
        self._end_s = trajectory.duration_s
        self._segment = 0
        self._powers = np.zeros(order)
        self._descending = tuple(range(order - 1, -1, -1))
        self._out = np.zeros(3 * joints)
        self._position, self._velocity, self._acceleration = self._out.reshape(3, joints)

    def sample(
        self,
        time_s: float,
        position_out: FloatArray,
        velocity_out: FloatArray,
        acceleration_out: FloatArray | None = None,
    ) -> None:
        """Write the state at ``time_s`` into the arrays (m,). Cycle: yes.

        Times before 0 give the start, times from the duration on the rest position. Going
        forward from period to period costs least; any other order is right too.
        """
        if time_s >= self._end_s:
            position_out[:] = self.trajectory.final_position
            velocity_out[:] = 0.0
            if acceleration_out is not None:
                acceleration_out[:] = 0.0
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
        np.dot(powers, self._segments[segment], self._out)
        position_out[:] = self._position
        velocity_out[:] = self._velocity
        if acceleration_out is not None:
            acceleration_out[:] = self._acceleration
