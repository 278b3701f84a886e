"""Limits that stop an axis by itself: limit switches, soft limits, following error."""

from __future__ import annotations

from enum import IntEnum
from functools import partial

import numpy as np

from robotd.api import FloatArray
from robotd_servo_model.world import ServoWorld
from robotd_sim.axis_states import AxisStates, AxisSwitches, Flags
from robotd_sim.motion import Motion
from robotd_sim.power import Power
from robotd_wmx_parameters import WmxParameters


class LimitType(IntEnum):
    """Reaction to a limit; numbers of the parameter file."""

    NONE = 0
    SERVO_OFF = 1
    DEC_SERVO_OFF = 2
    DEC = 3
    SLOW_DEC_SERVO_OFF = 4
    SLOW_DEC = 5
    SEPARATE = 6  # one type for each side


_SLOW = (LimitType.SLOW_DEC_SERVO_OFF, LimitType.SLOW_DEC)
_OFF = (LimitType.DEC_SERVO_OFF, LimitType.SLOW_DEC_SERVO_OFF)
_QUICK_STOP = 1  # FollowingErrorType
SWITCH, SOFT = 0, 1  # rows: a switch sees the measured position, a soft limit the command


class Guards:
    """Watches the axes after each tick while a limit is armed. Hold the world's lock."""

    def __init__(
        self,
        world: ServoWorld,
        states: AxisStates,
        motion: Motion,
        power: Power,
        switches: AxisSwitches,
    ) -> None:
        axes = world.servo.axes
        self._world, self._servo, self._states = world, world.servo, states
        self._motion, self._power = motion, power
        self._seen = np.zeros((2, axes), bool)
        self._switches = switches
        self._acted = [0] * axes  # number of the plan that a limit made
        self._reported: list[str | None] = [None] * axes  # the last following error
        world.on_watch = self._act
        power.on_home_lost = self.refresh

    def configure(self, parameters: WmxParameters) -> None:
        axes = self._servo.axes

        def of(name: str) -> FloatArray:
            return parameters[name][:axes]

        self._soft = of("SoftLimitNegativePos"), of("SoftLimitPositivePos")
        self._deceleration, self._slow = of("LSDec"), of("LSSlowDec")
        self._negative_types = np.stack([
            _types(parameters, "LSType", "NegativeLSType", axes),
            _types(parameters, "SoftLimitType", "NegativeSoftLimitType", axes),
        ])  # fmt: skip
        self._positive_types = np.stack([
            _types(parameters, "LSType", "PositiveLSType", axes),
            _types(parameters, "SoftLimitType", "PositiveSoftLimitType", axes),
        ])  # fmt: skip
        watched = of("FollowingErrorType") == _QUICK_STOP
        self._error_stopped = _where_set(of("FollowingErrorStopped"), watched)
        self._error_moving = _where_set(of("FollowingErrorMoving"), watched)
        self._watch_error = bool(np.isfinite([self._error_stopped, self._error_moving]).any())
        self.refresh()

    def refresh(self) -> None:
        """Recompute which limits are armed; soft limits act while the home position is known."""
        home = self._states.home_done
        negative, positive = self._soft
        low_switch = self._switches.high["negative_limit"]
        high_switch = self._switches.low["positive_limit"]
        self._low = np.stack([
            np.where(self._negative_types[SWITCH] == LimitType.NONE, -np.inf, low_switch),
            -_where_set(-negative, home & (self._negative_types[SOFT] != LimitType.NONE)),
        ])  # fmt: skip
        self._high = np.stack([
            np.where(self._positive_types[SWITCH] == LimitType.NONE, np.inf, high_switch),
            _where_set(positive, home & (self._positive_types[SOFT] != LimitType.NONE)),
        ])  # fmt: skip
        armed = (self._low > -np.inf).any() or (self._high < np.inf).any() or self._watch_error
        self._world.watch = self._look if armed else None

    def blocked(self, axis: int, direction: float) -> str | None:
        """Return why ``axis`` may not move in ``direction``; None: it may."""
        switch, soft = self._servo.watched[:, axis]
        if direction > 0:
            beyond, side = self._servo.watched[:, axis] > self._high[:, axis], "positive"
            limits = self._high[:, axis]
        else:
            beyond, side = self._servo.watched[:, axis] < self._low[:, axis], "negative"
            limits = self._low[:, axis]
        if beyond[SWITCH] and np.isinf(limits[SWITCH]):
            return f"{side} limit switch is closed"
        if beyond[SWITCH]:
            return f"{side} limit switch at {limits[SWITCH]:g} is reached ({switch:.6g})"
        if beyond[SOFT]:
            return f"{side} soft limit {limits[SOFT]:g} is reached ({soft:.6g})"
        return None

    def _look(self) -> bool:
        watched, seen = self._servo.watched, self._seen
        if np.greater(watched, self._high, seen).any() or np.less(watched, self._low, seen).any():
            return True
        return self._watch_error and bool(self._error_axes().any())

    def _error_axes(self) -> Flags:
        servo = self._servo
        limit = np.where(servo.command_velocity != 0, self._error_moving, self._error_stopped)
        return np.asarray(np.abs(servo.command - servo.position) > limit)

    def _act(self) -> None:
        servo, on = self._servo, self._states.servo_on
        speed = servo.command_velocity
        for kind in (SWITCH, SOFT):
            outwards = (servo.watched[kind] > self._high[kind]) & (speed > 0) & on
            for axis in np.flatnonzero(outwards):
                self._limit(int(axis), LimitType(int(self._positive_types[kind, axis])), 1.0)
            outwards = (servo.watched[kind] < self._low[kind]) & (speed < 0) & on
            for axis in np.flatnonzero(outwards):
                self._limit(int(axis), LimitType(int(self._negative_types[kind, axis])), -1.0)
        if self._watch_error:
            for axis in np.flatnonzero(self._error_axes() & on):
                self._follow_up(int(axis))

    def _follow_up(self, axis: int) -> None:
        """Stop an axis whose following error is too large, once for each command."""
        reason = self._states.reason
        if reason[axis] == self._reported[axis]:
            return
        servo = self._servo
        error = abs(servo.command[axis] - servo.position[axis])
        limits = self._error_moving if servo.command_velocity[axis] else self._error_stopped
        self._motion.quick_stop(axis)
        what = f"following error {error:.3g} is above {limits[axis]:g}"
        reason[axis] = self._reported[axis] = what

    def _limit(self, axis: int, limit: LimitType, direction: float) -> None:
        reason = self.blocked(axis, direction) or ""
        if limit is LimitType.SERVO_OFF:
            self._turn_off(axis, reason)
        elif self._acted[axis] != self._motion.plan(axis):
            deceleration = self._slow if limit in _SLOW else self._deceleration
            then = partial(self._turn_off, axis, reason) if limit in _OFF else None
            self._motion.brake(axis, float(deceleration[axis]), then)
            self._states.reason[axis] = reason
            self._acted[axis] = self._motion.plan(axis)

    def _turn_off(self, axis: int, reason: str) -> None:
        self._power.turn_off(axis)
        self._states.reason[axis] = reason


def _types(parameters: WmxParameters, both: str, one: str, axes: int) -> FloatArray:
    """Return the reaction on one side; ``both`` may defer to the side's parameter."""
    common, own = parameters[both][:axes], parameters[one][:axes]
    chosen = np.where(common == LimitType.SEPARATE, own, common)
    return np.where(chosen == LimitType.SEPARATE, LimitType.NONE, chosen)


def _where_set(value: FloatArray, condition: Flags) -> FloatArray:
    """``value`` where it is not 0 (the vendor's "off") and ``condition`` holds, else infinity."""
    return np.where(condition & (value != 0), value, np.inf)
