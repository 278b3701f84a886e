"""Setpoint limiter: jerk-limited motion towards targets that change while the joints move.

A target is approached by a time-optimal plan. A joint tracks a moving reference r with its
deviation e = s - r: e goes to zero in minimal time, within what r leaves of the joint's limits,
and from then on the joint moves exactly as r does.
"""

from __future__ import annotations

import numpy as np

from robotd.arrays import BoolArray, FloatArray
from robotd.motion.joint_planner import Bounds, JointPlanner
from robotd.motion.joints import JointLimits, MotionState

NEGLIGIBLE = 1e-9  # rad or m: numerical error of a plan's extremum
RESTING = 1e-9  # rad/s or m/s: slower is standstill
TRACKABLE = 0.9  # share of the velocity and acceleration limit that a reference may use
ON_REFERENCE = np.array([[1e-9], [1e-8], [1e-6]])  # position, velocity, acceleration: no deviation
STRONGER = 2.0  # factor of acceleration and jerk from one attempt to stop in time to the next
ATTEMPTS = 12


class SetpointLimiter:
    """One setpoint per period for m joints, limited in position, velocity, acceleration, jerk.

    A position limit is never left: no state is entered that could not be stopped in time. Where
    the motion *begins* too fast for that, acceleration and jerk exceed their limits as far as
    necessary, or as far as ``reset`` allows. A joint beyond a position limit comes back, or stops.

    One thread. Arrays are of shape (m,); SI units.

    Args:
        limits: of the joints; finite except for the positions.
        period_s: time between two setpoints.

    Attributes:
        state: (3, m) position, velocity and acceleration of the last setpoint.
        failures: number of plans that were not found; the joints stopped instead.
    """

    def __init__(self, limits: JointLimits, period_s: float) -> None:
        joints = len(limits.names)
        self.state: FloatArray = np.zeros((3, joints))
        self.failures = 0
        self._limits, self._period_s = limits, period_s
        self._bounds = Bounds.symmetric(limits.velocity, limits.acceleration, limits.jerk)
        self._planner, self._stop_planner = JointPlanner(joints), JointPlanner(joints)
        self._ramp_s = limits.acceleration / limits.jerk
        dt = period_s
        self._back = np.array([[1.0, -dt, dt**2 / 2.0], [0.0, 1.0, -dt], [0.0, 0.0, 1.0]])
        self._carefree = self._carefree_states()
        self._anywhere: FloatArray = np.full(joints, np.nan)
        self._rest: FloatArray = np.zeros(joints)
        self._every: BoolArray = np.ones(joints, bool)
        self._target, self._velocity = self._anywhere, self._rest  # of the plan
        self._elapsed_s = 0.0
        self._strongest: FloatArray = np.full(joints, np.inf)
        self.stop()

    @property
    def at_rest(self) -> bool:
        """No joint moves."""
        return bool((np.abs(self.state[1]) <= RESTING).all())

    def reset(self, state: MotionState, strongest: float = np.inf) -> None:
        """Continue from ``state``, which may be moving or beyond the limits, and stop.

        Args:
            state: position, velocity and acceleration.
            strongest: factor of the acceleration limits that no stop exceeds until the next
                reset. A stop that needs more leaves the position limit, and comes back.
        """
        self._strongest = strongest * self._limits.acceleration
        self.state[:] = state.position, state.velocity, state.acceleration
        self.stop()

    def stop(self) -> None:
        """Slow to rest in minimal time."""
        self.move(self._rest)

    def approach(self, target: FloatArray) -> None:
        """Move to rest at ``target``, which is clipped to the position limits."""
        target = self._within_limits(target)
        self._go(target, self._rest, self._bounds)

    def move(self, velocity: FloatArray) -> None:
        """Move with ``velocity``, which is clipped to the limits, to rest at a position limit."""
        limits, position = self._limits, self.state[0]
        velocity = np.clip(velocity, -limits.velocity, limits.velocity)
        above, below = position > limits.upper, position < limits.lower
        outward = (above & (velocity > 0.0)) | (below & (velocity < 0.0))
        back = np.where(outward, self._within_limits(position), self._anywhere)
        self._go(back, np.where(outward, 0.0, velocity), self._bounds)

    def step(self) -> FloatArray:
        """Return the next setpoint, ``state``, on the way to the last command's target."""
        before = self.state.copy()
        self._elapsed_s += self._period_s
        self.state[:] = self._planner.at(self._elapsed_s)
        if self._velocity.any() and not self._is_inside():
            unsafe = ~self._can_stop(*self._range(before[0]))
            if unsafe.any():
                self.state[:] = before
                self._end_at_limit(unsafe)
                self._elapsed_s = self._period_s
                self.state[:] = self._planner.at(self._elapsed_s)
        return self.state

    def after(self, seconds: float) -> FloatArray:
        """Return the setpoint ``seconds`` after the last one; not while tracking or at limits."""
        return self._planner.at(self._elapsed_s + seconds)

    def track(self, reference: FloatArray, target: FloatArray, stands: BoolArray) -> FloatArray:
        """Return the next setpoint, ``state``, on ``reference`` or on the way to it.

        Args:
            reference: (3, m) position, velocity and acceleration at the end of this period.
            target: (m,) where the reference leads; a joint whose reference exceeds the limits moves
                there by itself. Clipped to the limits.
            stands: (m,) targets that stand still and are not overshot.
        """
        carefree = not stands.any() and self._is_carefree(reference)
        if carefree and self._is_on(reference):
            self.state[:] = reference
            return self.state
        start, target = self.state.copy(), self._within_limits(target)
        tracked = self._every if carefree else self._trackable(reference)
        self._follow(start, reference, target, tracked)
        if carefree and self._is_carefree(self.state):
            return self.state
        unsafe = tracked & self._too_fast()
        if stands.any() or not self._is_inside():
            lower, upper = self._range(start[0])
            lower = np.where(stands & (start[0] > target), target - NEGLIGIBLE, lower)
            upper = np.where(stands & (start[0] < target), target + NEGLIGIBLE, upper)
            unsafe |= tracked & ~self._can_stop(lower, upper)
        if unsafe.any():
            self._follow(start, reference, target, tracked & ~unsafe)
        return self.state

    def _go(self, target: FloatArray, velocity: FloatArray, bounds: Bounds) -> None:
        """Plan from ``state`` to ``target`` (NaN: to ``velocity``) within the position limits."""
        self._target, self._velocity, self._elapsed_s = target, velocity, 0.0
        lower, upper = self._range(self.state[0])
        for _ in range(ATTEMPTS):
            if not self._planner.plan(self.state, target, velocity, bounds):
                self.failures += 1
                target, velocity = self._anywhere, self._rest
                continue
            left = self._planner.leaves(lower, upper) & (velocity == 0.0)
            if not left.any():
                return
            bounds = self._strengthen(bounds, left)

    def _strengthen(self, bounds: Bounds, joints: BoolArray) -> Bounds:
        """Return ``bounds`` with which ``joints`` stop in a shorter way."""
        factor = np.where(joints, STRONGER, 1.0)
        highest = np.minimum(bounds.highest_acceleration * factor, self._strongest)
        return bounds._replace(
            lowest_acceleration=-highest,
            highest_acceleration=highest,
            jerk=bounds.jerk * factor,
        )

    def _end_at_limit(self, joints: BoolArray) -> None:
        """Let ``joints``, which move with a velocity, come to rest at their position limits."""
        limits, velocity = self._limits, self._velocity
        end = np.where(velocity > 0.0, limits.upper, limits.lower)
        fastest = np.where(joints, np.abs(velocity), limits.velocity)
        bounds = self._bounds._replace(lowest_velocity=-fastest, highest_velocity=fastest)
        self._go(np.where(joints, end, self._target), np.where(joints, 0.0, velocity), bounds)

    def _is_on(self, reference: FloatArray) -> bool:
        """Return True where every joint is on ``reference``."""
        return bool((np.abs(self.state - self._back @ reference) < ON_REFERENCE).all())

    def _is_carefree(self, state: FloatArray) -> bool:
        """Return True where every joint is certainly able to stop from ``state`` (3, m)."""
        lowest, highest = self._carefree
        return bool(((state > lowest) & (state < highest)).all())

    def _trackable(self, reference: FloatArray) -> BoolArray:
        """Return (m,) joints whose reference is within what they can track."""
        limits, (position, velocity, acceleration) = self._limits, reference
        tracked: BoolArray = (
            (np.abs(velocity) <= TRACKABLE * limits.velocity)
            & (np.abs(acceleration) <= TRACKABLE * limits.acceleration)
            & (position >= limits.lower)
            & (position <= limits.upper)
        )
        return tracked

    def _follow(
        self, start: FloatArray, reference: FloatArray, target: FloatArray, tracked: BoolArray
    ) -> None:
        """Advance from ``start``: ``tracked`` joints to the reference, the others to target.

        Within the period the reference's acceleration is constant, so that all jerk is that of
        the deviation, which is limited.
        """
        bounds, period_s = self._bounds, self._period_s
        after = reference * tracked
        before = self._back @ after
        relative = Bounds(
            bounds.lowest_velocity - after[1],
            bounds.highest_velocity - after[1],
            bounds.lowest_acceleration - after[2],
            bounds.highest_acceleration - after[2],
            bounds.jerk,
        )
        if self._planner.plan(start - before, np.where(tracked, 0.0, target), self._rest, relative):
            self.state[:] = after + self._planner.at(period_s)
            return
        self.failures += 1
        self.state[:] = start
        self.stop()
        self.step()

    def _carefree_states(self) -> tuple[FloatArray, FloatArray]:
        """Return (3, m) lowest and highest state from which any stop is within the limits."""
        limits = self._limits
        acceleration = TRACKABLE * limits.acceleration
        gained = limits.acceleration * self._ramp_s / 2.0
        velocity = np.minimum(TRACKABLE * limits.velocity, limits.velocity - gained)
        speed = np.maximum(velocity, 0.0) + gained
        room = speed * (2.0 * self._ramp_s + speed / (2.0 * limits.acceleration))
        return (
            np.array([limits.lower + room, -velocity, -acceleration]),
            np.array([limits.upper - room, velocity, acceleration]),
        )

    def _too_fast(self) -> BoolArray:
        """Return (m,) joints whose acceleration cannot end before the velocity limit."""
        _, velocity, acceleration = self.state
        peak = velocity + acceleration * np.abs(acceleration) / (2.0 * self._limits.jerk)
        beyond: BoolArray = np.abs(peak) > self._limits.velocity
        return beyond

    def _is_inside(self) -> bool:
        """Return True where every joint is certainly able to stop within its limits."""
        position, speed, limits = self.state[0], np.abs(self.state[1]), self._limits
        speed += self._ramp_s * limits.acceleration / 2.0  # still gained while braking begins
        room = speed * (2.0 * self._ramp_s + speed / (2.0 * limits.acceleration))
        return bool(((position - room > limits.lower) & (position + room < limits.upper)).all())

    def _can_stop(self, lower: FloatArray, upper: FloatArray) -> BoolArray:
        """Return (m,) joints that come to rest from ``state`` without leaving the range."""
        if not self._stop_planner.plan(self.state, self._anywhere, self._rest, self._bounds):
            return np.zeros(len(self._rest), bool)
        within: BoolArray = ~self._stop_planner.leaves(lower, upper)
        return within

    def _within_limits(self, target: FloatArray) -> FloatArray:
        clipped: FloatArray = np.minimum(
            np.maximum(target, self._limits.lower), self._limits.upper
        )  # several times faster than np.clip
        return clipped

    def _range(self, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the allowed positions: unlimited where a joint is beyond its limit."""
        lower, upper = self._limits.lower - NEGLIGIBLE, self._limits.upper + NEGLIGIBLE
        lower = np.where(position < lower, -np.inf, lower)
        upper = np.where(position > upper, np.inf, upper)
        return lower, upper
