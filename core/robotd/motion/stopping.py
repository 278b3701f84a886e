"""A controlled stop along the path: the trajectory's own time slows down to a standstill.

With trajectory time s and rate r = ds/dt the joints move with q'(s)·r and accelerate with
q''(s)·r² - q'(s)·D, where D = -dr/dt ≥ 0. No joint leaves its path.
"""

from __future__ import annotations

from bisect import bisect_right

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.joints import JointLimits
from robotd.motion.trajectory import Trajectory

# Shortest stop is 1 ms. Only reached at standstill and by joints without a limit.
_MAX_DECELERATION = 1e3  # 1/s, of the rate
# Share of a joint's acceleration limit that goes into stopping where the plan itself brakes
# beyond the limit and leaves nothing to spare. Without it such a plan could not be stopped.
_MIN_SHARE = 0.2
# The cells of the next chunk are twice as wide; a few of a chunk are evaluated together.
_CELLS, _AT_ONCE, _SAMPLES = 32, 4, 5
_WITHIN = np.linspace(0.0, 1.0, _SAMPLES)  # a cell, both edges included
_MAX_CELL_S = 0.02
_UNLIMITED = 1e12  # rad/s², replaces inf, with which the products below would be NaN
_MIN_SPEED = 1e-9  # rad/s; slower joints count as standing


class StopPlan:
    """Ramp of the rate to 0, in pieces of constant deceleration. One owner thread.

    The pieces are planned when ``at`` first needs them: a whole stop takes 0.6 to 0.9 ms, half a
    control period, and the setpoint of the period in which the stop begins would be too late.
    """

    def __init__(
        self, trajectory: Trajectory, from_s: float, acceleration: FloatArray, rate: float
    ) -> None:
        self._trajectory, self._acceleration = trajectory, acceleration
        self._cell_s = _first_cell(trajectory, from_s, acceleration)
        self._edges: FloatArray = np.array([from_s])
        # Between the pieces found so far, their beginning and end included.
        self._elapsed_s, self._times_s, self._rates = [0.0], [from_s], [rate]
        self._decelerations: list[float] = []  # of the pieces

    def at(self, elapsed_s: float) -> tuple[float, float, float]:
        """Return trajectory time (s), rate, and its deceleration (1/s). Control loop.

        Before 0 it is the first rate; from the end of the stop on it is 0.
        """
        self._plan_until(elapsed_s)
        if elapsed_s >= self._elapsed_s[-1]:
            return self._times_s[-1], 0.0, 0.0
        if elapsed_s < 0.0:
            return self._times_s[0] + elapsed_s * self._rates[0], self._rates[0], 0.0
        piece = bisect_right(self._elapsed_s, elapsed_s) - 1
        since, slope = elapsed_s - self._elapsed_s[piece], self._decelerations[piece]
        rate = self._rates[piece] - slope * since
        return self._times_s[piece] + (self._rates[piece] + rate) / 2.0 * since, rate, slope

    def _plan_until(self, elapsed_s: float) -> None:
        """Plan the pieces up to ``elapsed_s``, and at least the first."""
        end_s = self._trajectory.duration_s
        while self._moves_before(end_s) and self._elapsed_s[-1] <= elapsed_s:
            if len(self._edges) == 1:
                edges = self._times_s[-1] + self._cell_s * np.arange(_CELLS + 1)
                self._edges = np.minimum(edges, end_s)
                self._cell_s = min(2.0 * self._cell_s, _MAX_CELL_S)
            edges, self._edges = self._edges[: _AT_ONCE + 1], self._edges[_AT_ONCE:]
            limit, braking, speed = _capacity(self._trajectory, edges, self._acceleration)
            for cell, cell_end_s in enumerate(edges[1:].tolist()):
                if not self._moves_before(cell_end_s):
                    break
                spare = limit - braking[cell] * self._rates[-1] ** 2
                allowed = np.where(spare > 0.0, spare, _MIN_SHARE * limit) / speed[cell]
                self._slow_down(min(float(allowed.min()), _MAX_DECELERATION), cell_end_s)

    def _moves_before(self, end_s: float) -> bool:
        return self._rates[-1] > 0.0 and self._times_s[-1] < end_s

    def _slow_down(self, slope: float, end_s: float) -> None:
        """Add a piece until ``end_s``, or until standstill."""
        time_s, before = self._times_s[-1], self._rates[-1]
        rate = max(before**2 - 2.0 * slope * (end_s - time_s), 0.0) ** 0.5
        if rate > 0.0:
            took_s = 2.0 * (end_s - time_s) / (before + rate)
        else:
            took_s, end_s = before / slope, time_s + before**2 / (2.0 * slope)
        self._decelerations.append(slope)
        self._elapsed_s.append(self._elapsed_s[-1] + took_s)
        self._times_s.append(end_s)
        self._rates.append(rate)


def plan_stop(
    trajectory: Trajectory, from_s: float, limits: JointLimits, rate: float = 1.0
) -> StopPlan:
    """Return the quickest stop along the path within every joint's acceleration limit.

    In each short cell of the path the rate falls as fast as ``|q''_j|·r² + |q'_j|·D ≤ limit``
    allows for the joints that the plan is braking already, and ``|q'_j|·D ≤ limit`` for those
    that it is speeding up (there the two terms cancel). Where a plan brakes beyond a limit by
    itself a fifth of the limit is added, so that every stop ends. The end of the trajectory,
    which is a standstill, ends the stop at the latest.

    Args:
        trajectory: runs at ``rate`` up to the stop.
        from_s: trajectory time at which the stop begins.
        limits: of the same joints; their accelerations count.
        rate: ratio of trajectory time to real time, 0 to 1.
    """
    from_s = min(max(from_s, 0.0), trajectory.duration_s)
    return StopPlan(trajectory, from_s, np.minimum(limits.acceleration, _UNLIMITED), rate)


def _first_cell(trajectory: Trajectory, from_s: float, acceleration: FloatArray) -> float:
    """Return the cell width; a stop at the present speed takes about 24."""
    speed = np.maximum(np.abs(trajectory.state_at(from_s).velocity), _MIN_SPEED)
    stop_s = 0.5 / float(np.min(np.minimum(acceleration / speed, _MAX_DECELERATION)))
    return min(max(stop_s / 24.0, 1e-3), _MAX_CELL_S)


def _capacity(
    trajectory: Trajectory, edges: FloatArray, limit: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return limit, the plan's own braking, and speed, per cell and sample in it.

    Shapes (samples * m,) and twice (cells, samples * m).
    """
    times_s = edges[:-1, None] + (edges[1:] - edges[:-1])[:, None] * _WITHIN
    _, velocity, acceleration = trajectory.evaluate(times_s.reshape(-1))
    speed = np.abs(velocity)
    braking = np.maximum(-acceleration * np.sign(velocity), 0.0)
    braking[speed < _MIN_SPEED] = 0.0
    shape = (len(times_s), -1)
    return (
        np.tile(limit, _SAMPLES),
        braking.reshape(shape),
        np.maximum(speed, _MIN_SPEED).reshape(shape),
    )


def stoppable_velocity(acceleration: FloatArray, jerk: FloatArray, within_s: float) -> FloatArray:
    """Return the highest velocity (m,) of a motion that always stops ``within_s``.

    The worst moment is that of the highest acceleration a towards the velocity v: the stop takes
    a/j until the joint moves with v, and then what it takes from there. Below v = a²/j the
    acceleration limit is not reached, the highest one is sqrt(v·j), and both together take
    3·sqrt(v/j). Above it they take 2·a/j + v/a.

    Args:
        acceleration, jerk: (m,) limits, positive; in rad/s² and rad/s³, or m/s² and m/s³.
        within_s: not negative; 0 gives 0.
    """
    ramp_s = acceleration / jerk
    below = jerk * (within_s / 3.0) ** 2
    above = acceleration * (within_s - 2.0 * ramp_s)
    return np.where(within_s <= 3.0 * ramp_s, below, above)
