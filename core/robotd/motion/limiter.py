"""Setpoint limiter: jerk-limited motion towards targets that change while the joints move.

A target is approached by a time-optimal plan. A joint tracks a moving reference r with its
deviation e = s - r: e goes to zero in minimal time, within what r leaves of the joint's limits,
and from then on the joint moves exactly as r does.

What goes into a plan is computed with lists, which the planner takes: for six joints they are as
fast as arrays.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.joint_planner import Bounds, JointPlanner, Row
from robotd.motion.joints import JointLimits, MotionState

POSITION_ROUNDING = 1e-9  # rad or m: numerical error of a plan's extremum
STANDSTILL_VELOCITY = 1e-9  # rad/s or m/s: slower is standstill
TRACKABLE_SHARE = 0.9  # share of the velocity and acceleration limit that a reference may use
ON_REFERENCE = np.array([[1e-9], [1e-8], [1e-6]])  # position, velocity, acceleration: no deviation
BRAKE_ESCALATION = 2.0  # factor of acceleration and jerk from one attempt to stop to the next
MAX_STOP_ATTEMPTS = 12


class SetpointLimiter:
    """One setpoint per period for m joints, limited in position, velocity, acceleration, jerk.

    Position limits come first: no setpoint is given from which a joint could not stop before its
    limit. Where the *first* state is already too fast for that, the stop exceeds the limits of
    acceleration and jerk as far as necessary, at most by the factor given to ``reset``. A joint
    beyond a position limit may only move back, or stop.

    One thread. Arrays are of shape (m,); SI units.

    ``limits``: of the joints; finite except for the positions.

    Attributes:
        state: (3, m) position, velocity and acceleration of the last setpoint.
        failures: number of plans that were not found; the joints stopped instead.
    """

    def __init__(self, limits: JointLimits, period_s: float) -> None:
        joints = len(limits.names)
        self.state: FloatArray = np.zeros((3, joints))
        self.failures = 0
        self._period_s = period_s
        self._lower, self._upper = limits.lower.tolist(), limits.upper.tolist()
        self._bounds = Bounds.symmetric(
            limits.velocity.tolist(), limits.acceleration.tolist(), limits.jerk.tolist()
        )
        self._planner, self._stop_planner = JointPlanner(joints), JointPlanner(joints)
        strong, jerk = self._bounds.highest_acceleration, self._bounds.jerk
        self._twice_jerk = [2.0 * value for value in jerk]
        self._stop_factors = [  # of ``_surely_stops``
            (value / 2.0, 2.0 * value, change, 2.0 * change)
            for value, change in zip(strong, jerk, strict=True)
        ]
        self._trackable_velocity = [
            TRACKABLE_SHARE * value for value in self._bounds.highest_velocity
        ]
        self._trackable_acceleration = [TRACKABLE_SHARE * value for value in strong]
        dt = period_s
        self._back = np.array([[1.0, -dt, dt**2 / 2.0], [0.0, 1.0, -dt], [0.0, 0.0, 1.0]])
        self._stoppable = _stoppable_states(limits)
        self._anywhere, self._rest = [math.nan] * joints, [0.0] * joints
        self._target, self._velocity = self._anywhere, self._rest  # of the plan
        self._elapsed_s = 0.0
        self._range_of_velocity = self._bounds.lowest_velocity, self._bounds.highest_velocity
        self._strongest = [math.inf] * joints
        self.stop()

    @property
    def at_rest(self) -> bool:
        """True while no joint moves."""
        return bool((np.abs(self.state[1]) <= STANDSTILL_VELOCITY).all())

    def reset(self, state: MotionState, strongest: float = np.inf) -> None:
        """Continue from ``state``, which may be moving or beyond the limits, and stop.

        ``strongest``: factor of the acceleration limits that no stop exceeds until the next reset.
        A joint that cannot stop before its position limit with that passes it and comes back. While
        a joint is beyond its limit, new commands are planned with the ordinary acceleration.
        """
        self._strongest = [strongest * limit for limit in self._bounds.highest_acceleration]
        self.state[:] = state.position, state.velocity, state.acceleration
        self.stop()

    def stop(self) -> None:
        """Slow to rest in minimal time."""
        self._go(self._anywhere, self._rest, self._bounds)

    def approach(self, target: FloatArray) -> None:
        """Move to rest at ``target``, which is clipped to the position limits."""
        self._go(self._within_limits(target.tolist()), self._rest, self._bounds)

    def move(self, velocity: FloatArray) -> None:
        """Move with ``velocity``, which is clipped to the limits, to rest at a position limit."""
        fastest = np.array(self._bounds.highest_velocity)
        velocity, position = np.clip(velocity, -fastest, fastest), self.state[0]
        above, below = position > self._upper, position < self._lower
        outward = (above & (velocity > 0.0)) | (below & (velocity < 0.0))
        back = np.where(outward, np.clip(position, self._lower, self._upper), np.nan)
        self._go(back.tolist(), np.where(outward, 0.0, velocity).tolist(), self._bounds)

    def step(self) -> FloatArray:
        """Return the next setpoint, ``state``, on the way to the last command's target."""
        moves = any(self._velocity)
        before = self.state.tolist() if moves else []
        self._elapsed_s += self._period_s
        self.state[:] = after = self._planner.at(self._elapsed_s)
        if moves:
            unsafe = self._unstoppable(after, *self._range(before[0]))
            if True in unsafe:
                self.state[:] = before
                self._end_at_limit(unsafe)
                self._elapsed_s = self._period_s
                self.state[:] = self._planner.at(self._elapsed_s)
        return self.state

    def peak_velocity(self) -> FloatArray:
        """Return the velocities (m,) with which the present accelerations end."""
        _, velocity, acceleration = self.state
        jerk = np.array(self._bounds.jerk)
        peak: FloatArray = velocity + acceleration * np.abs(acceleration) / (2.0 * jerk)
        return peak

    def stop_positions(self) -> FloatArray:
        """Return the positions (m,) that no stop from the last setpoint goes beyond.

        As ``_surely_stops``.
        """
        position, _, acceleration = self.state
        peak, strong = self.peak_velocity(), np.array(self._bounds.highest_acceleration)
        seconds = (np.abs(acceleration) + 0.5 * strong) / np.array(self._bounds.jerk)
        positions: FloatArray = position + peak * (seconds + 0.5 * np.abs(peak) / strong)
        return positions

    def slow_down(self, before: FloatArray, velocity: FloatArray) -> FloatArray:
        """Return another setpoint, from the state ``before`` (3, m) the last one, and plan anew.

        It is on the way to ``velocity``, which is ``peak_velocity`` times a factor below 1.
        """
        target, then, bounds = self._target, self._velocity, self._bounds_of_plan
        self.state[:] = before
        self._go(self._anywhere, velocity.tolist(), self._bounds)
        self.state[:] = self._planner.at(self._period_s)
        self._go(target, then, bounds)
        return self.state

    def after(self, seconds: float) -> FloatArray:
        """Return the setpoint ``seconds`` after the last one; not while tracking or at limits."""
        return np.array(self._planner.at(self._elapsed_s + seconds))

    def track(
        self,
        reference: FloatArray,
        target: Row,
        rests: list[bool],
        velocity_range: tuple[Row, Row] | None = None,
    ) -> FloatArray:
        """Return the next setpoint, ``state``, on ``reference`` or on the way to it.

        Args:
            reference: (3, m) position, velocity and acceleration at the end of this period; NaN
                for joints that are not commanded.
            target: where the reference leads; a joint whose reference exceeds the limits moves
                there by itself. Clipped to the limits. NaN: the joint slows to rest.
            rests: targets at rest and are not overshot.
            velocity_range: lowest and highest velocity, within the limits; None: the limits.
        """
        bounds = self._bounds
        self._range_of_velocity = velocity_range or (
            bounds.lowest_velocity,
            bounds.highest_velocity,
        )
        unconstrained = True not in rests and self._can_stop(reference)
        start = self.state.copy()
        deviation = start - self._back.dot(reference)
        if unconstrained and _is_negligible(deviation):
            self.state[:] = reference
            return self.state
        if unconstrained:
            self._advance(start, reference, deviation, self._rest)
            if self._can_stop(self.state) and (
                velocity_range is None or True not in self._too_fast(self.state.tolist())
            ):
                return self.state
        target, tracked = self._within_limits(target), self._trackable(reference)
        if not unconstrained:
            self._advance_some(start, reference, deviation, target, tracked)
        lower, upper = self._range(start[0].tolist())
        for joint, (begin, end) in enumerate(zip(start[0].tolist(), target, strict=True)):
            if rests[joint] and begin > end:
                lower[joint] = end - POSITION_ROUNDING
            elif rests[joint] and begin < end:
                upper[joint] = end + POSITION_ROUNDING
        state = self.state.tolist()
        unsafe = map(operator.or_, self._unstoppable(state, lower, upper), self._too_fast(state))
        safe = [kept and not cannot for kept, cannot in zip(tracked, unsafe, strict=True)]
        if safe != tracked:
            self._advance_some(start, reference, deviation, target, safe)
        return self.state

    def _go(self, target: Row, velocity: Row, bounds: Bounds) -> None:
        """Plan from ``state`` to ``target`` (NaN: to ``velocity``) within the position limits."""
        self._target, self._velocity, self._elapsed_s = target, velocity, 0.0
        self._bounds_of_plan = bounds
        start = self.state.tolist()
        jerk = self._jerk(start[2])
        if jerk != bounds.jerk:
            bounds = bounds._replace(jerk=jerk)
        lower, upper = self._range(start[0])
        for _ in range(MAX_STOP_ATTEMPTS):
            if not self._planner.plan(start, target, velocity, bounds):
                self.failures += 1
                target, velocity = self._anywhere, self._rest
                continue
            leaves = self._planner.leaves(lower, upper)
            left = [leaving and not speed for leaving, speed in zip(leaves, velocity, strict=True)]
            if True not in left:
                return
            bounds = self._strengthen(bounds, left)

    def _strengthen(self, bounds: Bounds, joints: list[bool]) -> Bounds:
        """Return ``bounds`` with which ``joints`` stop in a shorter distance."""
        factors = [BRAKE_ESCALATION if brakes else 1.0 for brakes in joints]
        highest = map(operator.mul, bounds.highest_acceleration, factors)
        return Bounds.symmetric(
            bounds.highest_velocity,
            list(map(min, highest, self._strongest)),
            list(map(operator.mul, bounds.jerk, factors)),
        )

    def _end_at_limit(self, joints: list[bool]) -> None:
        """Let ``joints``, which move with a velocity, come to rest at their position limits."""
        target, velocity = list(self._target), list(self._velocity)
        fastest = list(self._bounds.highest_velocity)
        for joint, ends in enumerate(joints):
            if ends:
                target[joint] = (self._upper if velocity[joint] > 0.0 else self._lower)[joint]
                fastest[joint], velocity[joint] = abs(velocity[joint]), 0.0
        bounds = self._bounds
        self._go(
            target,
            velocity,
            Bounds.symmetric(fastest, bounds.highest_acceleration, bounds.jerk),
        )

    def _can_stop(self, state: FloatArray) -> bool:
        """Return True where every joint is certainly able to stop from ``state`` (3, m)."""
        lowest, highest = self._stoppable
        return int(np.count_nonzero((state > lowest) & (state < highest))) == state.size

    def _trackable(self, reference: FloatArray) -> list[bool]:
        """Return the joints that can track their reference."""
        limits = self._trackable_velocity, self._trackable_acceleration
        rows = (*reference.tolist(), *limits, self._lower, self._upper)
        return [
            -fastest <= v <= fastest and -strongest <= a <= strongest and low <= p <= high
            for p, v, a, fastest, strongest, low, high in zip(*rows, strict=True)
        ]

    def _advance_some(
        self,
        start: FloatArray,
        reference: FloatArray,
        deviation: FloatArray,
        target: Row,
        tracked: list[bool],
    ) -> None:
        """Advance from ``start``: ``tracked`` joints to the reference, the others to target."""
        if False in tracked:
            target = [0.0 if held else end for held, end in zip(tracked, target, strict=True)]
            reference = np.where(tracked, reference, 0.0)
            deviation = np.where(tracked, deviation, start)
        else:
            target = self._rest
        self._advance(start, reference, deviation, target)

    def _advance(
        self, start: FloatArray, reference: FloatArray, deviation: FloatArray, target: Row
    ) -> None:
        """Advance from ``start``, ``deviation`` away from ``reference``, to a deviation ``target``.

        Within the period the reference's acceleration is constant, so that all jerk is that of
        the deviation, which is limited.
        """
        _, velocity, acceleration = reference.tolist()
        bounds, (slowest, fastest) = self._bounds, self._range_of_velocity
        relative = Bounds(
            _difference(slowest, velocity),
            _difference(fastest, velocity),
            _difference(bounds.lowest_acceleration, acceleration),
            _difference(bounds.highest_acceleration, acceleration),
            self._jerk(start[2].tolist()),
        )
        if self._planner.plan(deviation.tolist(), target, self._rest, relative):
            self.state[:] = self._planner.at(self._period_s)
            self.state += reference
            return
        self.failures += 1
        self.state[:] = start
        self.stop()
        self.step()

    def _jerk(self, acceleration: Row) -> Row:
        """Return the jerk limits of a plan that begins with ``acceleration``.

        The velocity changes by a²/2J while an acceleration a ends. Where a stop exceeds the limit
        of a, J is raised so that the velocity changes by no more than from that limit.
        """
        strongest, jerk = self._bounds.highest_acceleration, self._bounds.jerk
        if all(map(operator.le, map(abs, acceleration), strongest)):
            return jerk
        return [
            value * max(1.0, (a / limit) ** 2)
            for a, limit, value in zip(acceleration, strongest, jerk, strict=True)
        ]

    def _too_fast(self, state: Sequence[Row]) -> list[bool]:
        """Return the joints whose acceleration cannot end within the range of velocities."""
        _, velocity, acceleration = state
        limits = *self._range_of_velocity, self._twice_jerk
        return [
            not slowest <= v + a * abs(a) / twice_jerk <= fastest
            for v, a, slowest, fastest, twice_jerk in zip(
                velocity, acceleration, *limits, strict=True
            )
        ]

    def _unstoppable(self, state: Sequence[Row], lower: Row, upper: Row) -> list[bool]:
        """Return the joints that leave the range before they come to rest from ``state``."""
        if self._surely_stops(state, lower, upper):
            return [False] * len(lower)
        if not self._stop_planner.plan(state, self._anywhere, self._rest, self._bounds):
            return [True] * len(lower)
        return self._stop_planner.leaves(lower, upper)

    def _surely_stops(self, state: Sequence[Row], lower: Row, upper: Row) -> bool:
        """Return True where each joint certainly stops within the range.

        With acceleration limit A and jerk limit J, the acceleration a ends within |a|/J, at a speed
        of at most v_p = v + a²/2J, and the stop from there takes at most v_p/A + A/J.
        """
        joints = zip(*state, lower, upper, self._stop_factors, strict=True)
        for p, v, a, low, high, (half_strong, twice_strong, jerk, twice_jerk) in joints:
            peak = v + a * abs(a) / twice_jerk
            slowest, fastest = (v, peak) if v < peak else (peak, v)
            seconds = (abs(a) + half_strong) / jerk
            forward = max(0.0, fastest)
            if p + forward * (seconds + forward / twice_strong) > high:
                return False
            backward = -slowest if slowest < 0.0 else 0.0
            if p - backward * (seconds + backward / twice_strong) < low:
                return False
        return True

    def _within_limits(self, target: Row) -> Row:
        """Return ``target`` clipped to the position limits; NaN stays."""
        return list(map(min, map(max, target, self._lower), self._upper))

    def _range(self, position: Row) -> tuple[Row, Row]:
        """Return the allowed positions: unlimited where a joint is beyond its limit."""
        return (
            [
                low - POSITION_ROUNDING if place >= low - POSITION_ROUNDING else -math.inf
                for place, low in zip(position, self._lower, strict=True)
            ],
            [
                high + POSITION_ROUNDING if place <= high + POSITION_ROUNDING else math.inf
                for place, high in zip(position, self._upper, strict=True)
            ],
        )


def _stoppable_states(limits: JointLimits) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest state (3, m) of which any stop keeps the limits."""
    ramp_s = limits.acceleration / limits.jerk
    acceleration = TRACKABLE_SHARE * limits.acceleration
    gained = limits.acceleration * ramp_s / 2.0
    velocity = np.minimum(TRACKABLE_SHARE * limits.velocity, limits.velocity - gained)
    speed = np.maximum(velocity, 0.0) + gained
    room = speed * (2.0 * ramp_s + speed / (2.0 * limits.acceleration))
    return (
        np.array([limits.lower + room, -velocity, -acceleration]),
        np.array([limits.upper - room, velocity, acceleration]),
    )


def _is_negligible(deviation: FloatArray) -> bool:
    """Return True where every joint is on its reference."""
    return int(np.count_nonzero(np.abs(deviation) < ON_REFERENCE)) == deviation.size


def _difference(minuend: Row, subtrahend: Row) -> Row:
    return list(map(operator.sub, minuend, subtrahend))
