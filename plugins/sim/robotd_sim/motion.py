"""Commands of the axes: moves, velocity commands, stops and streams."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import ceil, floor

import numpy as np

from robotd.api import (
    CommandMode,
    FloatArray,
    LateSetpoint,
    Operation,
    Profile,
    Segment,
    profile_to_position,
    profile_to_rest,
    profile_to_velocity,
)
from robotd_servo_model.world import FOREVER, ServoWorld
from robotd_sim.axis_states import AxisStates, Flags
from robotd_wmx_parameters import WmxParameters

_STANDSTILL_VELOCITY = 1e-3  # a last setpoint slower than this (rad/s) ends a stream at rest
EXTRAPOLATION_PERIODS = 1.5
"""One missing setpoint, and the half period by which the next one may be late."""
_WATCHDOG_S = 0.5  # without a reader, after which velocity commands end
_ROUNDING = 1e-6  # part of a tick by which computed times may be late


class Motion:
    """The commands of all axes. Hold the world's lock; arguments and states are checked before.

    ``ramp`` is the deceleration of stops that no command gave one, shape (n_axes,); NaN takes
    the quick stop's.
    """

    def __init__(
        self,
        world: ServoWorld,
        states: AxisStates,
        ramp: FloatArray,
        period_s: float,
        stream_timeout: int,
    ) -> None:
        self._world, self._servo, self._states, self._ramp = world, world.servo, states, ramp
        axes = world.servo.axes
        self._plans = [0] * axes  # number of each axis' plan; actions of older plans are void
        self._deceleration = [0.0] * axes
        self._quick = [False] * axes
        self._quick_stop_dec: FloatArray = np.ones(axes)
        self._may_brake_harder = np.zeros(axes, bool)
        self._read = 0  # tick at which the values were read last
        self._watching = False
        self.stream = Stream(world, period_s, stream_timeout, self._stream_timed_out)

    def configure(self, parameters: WmxParameters) -> None:
        axes = self._servo.axes
        self._quick_stop_dec = parameters["QuickStopDec"][:axes]
        self._may_brake_harder = parameters["ProhibitOvertravel"][:axes] != 0

    def note_read(self) -> None:
        """Note that the values are read now: the process that commands the axes goes on."""
        self._read = self._world.tick

    def plan(self, axis: int) -> int:
        """Number of the present plan; another number is another command."""
        return self._plans[axis]

    def is_idle(self, axis: int) -> bool:
        """Return True if nothing is executed and the command is at rest."""
        return self._states.operation[axis] == Operation.IDLE and not self._world.moves(axis)

    def move(self, axis: int, target: float, profile: Profile) -> None:
        hardest = profile.deceleration
        if self._may_brake_harder[axis]:
            hardest = max(hardest, float(self._quick_stop_dec[axis]))
        plan = profile_to_position(*self._command(axis), target, profile, hardest)
        self._deceleration[axis] = profile.deceleration
        self._begin(axis, plan, Operation.POSITION, completes=True)

    def jog(self, axis: int, profile: Profile) -> None:
        plan = profile_to_velocity(
            *self._command(axis), profile.velocity, profile.acceleration, profile.deceleration
        )
        self._deceleration[axis] = profile.deceleration
        self._begin(axis, plan, Operation.VELOCITY)
        self._watch()

    def stop(self, axis: int) -> None:
        """Brake with the running command's deceleration; a running stop stays as it is."""
        if self._states.operation[axis] == Operation.GUIDING:
            self.hold(axis, float(self._servo.position[axis]))
        elif self._states.operation[axis] not in (Operation.IDLE, Operation.STOPPING):
            self.brake(axis, self._stop_deceleration(axis))

    def quick_stop(self, axis: int) -> None:
        """Brake with QuickStopDec; takes over a running stop, but not a quick stop."""
        if self._states.operation[axis] == Operation.GUIDING:
            self.stop(axis)
        elif self._states.operation[axis] != Operation.IDLE and not self._quick[axis]:
            self.brake(axis, float(self._quick_stop_dec[axis]))
            self._quick[axis] = True

    def brake(self, axis: int, deceleration: float, then: Callable[[], None] | None = None) -> None:
        """Stop with ``deceleration`` whatever runs, and call ``then`` at rest."""
        plan = profile_to_rest(*self._command(axis), deceleration)
        self._begin(axis, plan, Operation.STOPPING, then=then)

    def coast(self, axis: int, deceleration: float) -> None:
        """End the command: the axis coasts to rest, and executes nothing."""
        self._begin(axis, profile_to_rest(*self._command(axis), deceleration), Operation.IDLE)

    def hold(self, axis: int, position: float) -> None:
        """Hold ``position``."""
        self._begin(axis, [Segment(0.0, position, 0.0, 0.0)], Operation.IDLE)

    def guide(self, axis: int, position: float) -> None:
        """Let the axis be moved by hand from ``position``: the loop is open, its weight carried."""
        self._begin(axis, [Segment(0.0, position, 0.0, 0.0)], Operation.GUIDING)
        self._servo.close_loop(axis, closed=False)
        self._servo.place(axis, position, position, 0.0)

    def begin_stream(self, axis: int) -> None:
        if self._states.operation[axis] == Operation.STREAM:
            return
        self._drop(axis)
        self._states.operation[axis] = Operation.STREAM
        self._world.busy(axis, FOREVER)
        self.stream.begin(axis, by_velocity=self._states.mode[axis] == CommandMode.VELOCITY)

    def end_stream(self, axis: int) -> None:
        """Run to the last setpoint and stay there; still moving there, brake instead."""
        stream, tick = self.stream, self._world.tick
        if not stream.following[axis]:
            return
        if abs(stream.velocity[axis]) > _STANDSTILL_VELOCITY:
            self.brake(axis, self._stop_deceleration(axis))
            return
        remaining_s = max(0.0, (stream.end - tick) * self._servo.tick_s)
        stay = Segment(remaining_s, stream.position[axis], 0.0, 0.0)
        self._begin(axis, [stay], Operation.IDLE)
        self._states.motion_complete[axis] = True

    def _stream_timed_out(self) -> None:
        for axis in np.flatnonzero(self.stream.following):
            self.brake(int(axis), self._stop_deceleration(int(axis)))
            self._states.reason[axis] = "setpoints stayed away"

    def _watch(self) -> None:
        """Stop velocity commands once nothing is read for ``_WATCHDOG_S``; moves have an end."""
        self.note_read()  # a command counts as well
        if not self._watching:
            self._watching = True
            self._world.at(self._read + round(_WATCHDOG_S / self._servo.tick_s), self._look)

    def _look(self) -> None:
        self._watching = False
        running = self._states.operation == Operation.VELOCITY
        if not running.any():
            return
        due = self._read + round(_WATCHDOG_S / self._servo.tick_s)
        if self._world.tick < due:
            self._watching = True
            self._world.at(due, self._look)
            return
        for axis in np.flatnonzero(running).tolist():
            self.brake(axis, self._stop_deceleration(axis))
            self._states.reason[axis] = "the process that commands the axes stands still"

    def _command(self, axis: int) -> tuple[float, float]:
        return float(self._servo.command[axis]), float(self._servo.command_velocity[axis])

    def _stop_deceleration(self, axis: int) -> float:
        ramp = float(self._ramp[axis])
        if self._states.operation[axis] != Operation.STREAM and self._deceleration[axis] > 0:
            ramp = self._deceleration[axis]
        return float(self._quick_stop_dec[axis]) if np.isnan(ramp) else ramp

    def _drop(self, axis: int) -> int:
        """Forget what was planned; returns the number of the plan to come."""
        self._plans[axis] += 1
        self._quick[axis] = False
        if self._states.operation[axis] == Operation.GUIDING and self._states.servo_on[axis]:
            self._servo.close_loop(axis, closed=True)  # where the axis was left
        self.stream.drop(axis)
        self._states.motion_complete[axis] = False
        if self._states.connected[axis] and not self._states.amp_alarm[axis]:
            self._states.reason[axis] = ""  # of a past stop; an alarm and a lost slave remain
        return self._plans[axis]

    def _begin(
        self,
        axis: int,
        plan: list[Segment],
        operation: Operation,
        *,
        completes: bool = False,
        then: Callable[[], None] | None = None,
    ) -> None:
        """Load the first segment now and the others as they begin.

        A segment is loaded at the last tick before it begins, so that the next one lies on it.
        """
        number, begun, tick_s = self._drop(axis), self._world.tick, self._servo.tick_s
        self._states.operation[axis] = operation

        def load(segment: Segment) -> None:
            if number == self._plans[axis]:
                now = self._world.tick
                position, velocity = segment.at((now - begun) * tick_s)
                self._servo.follow(axis, now, position, velocity, segment.acceleration)

        def finish() -> None:
            if number == self._plans[axis]:
                self._states.operation[axis] = Operation.IDLE
                self._states.motion_complete[axis] = completes
                if then is not None:
                    then()

        for segment in plan:
            before = ceil(segment.start_s / tick_s - _ROUNDING) - 1
            if before <= 0:
                load(segment)
            else:
                self._world.at(begun + before, partial(load, segment))
        last = plan[-1]
        if last.velocity:
            self._world.busy(axis, FOREVER)
            return
        ended = begun + ceil(last.start_s / tick_s - _ROUNDING)
        self._world.busy(axis, ended)
        if operation not in (Operation.IDLE, Operation.GUIDING):
            self._world.at(ended, finish)


class Stream:
    """Setpoints of the axes in ``following``, each to be reached at its due time.

    Between two setpoints the command is the cubic that continues position and velocity, and
    ends in the setpoint's; for an axis in ``by_velocity``, whose position follows from even
    acceleration to the velocity, it is a parabola. When a setpoint is overdue the command
    continues with the last velocity for ``EXTRAPOLATION_PERIODS`` and then holds; the velocity of
    an axis in ``by_velocity`` stays. A setpoint that arrives with less than half a period left is
    rejected, for the axes could reach it only by a jump. After ``timeout`` ticks ``on_timeout``
    is called, unless the axes are at rest and still wait for the first setpoint.
    """

    def __init__(
        self, world: ServoWorld, period_s: float, timeout: int, on_timeout: Callable[[], None]
    ) -> None:
        axes = world.servo.axes
        self.following: Flags = np.zeros(axes, bool)
        self.by_velocity: Flags = np.zeros(axes, bool)
        self.position = [0.0] * axes  # the last setpoint
        self.velocity = [0.0] * axes
        self.end = 0.0  # tick, with its fraction, at which the last setpoint is due
        self._world, self._timeout, self._on_timeout = world, timeout, on_timeout
        self._period = period_s / world.servo.tick_s
        self._followers: list[tuple[int, bool]] = []  # axes, and whether by velocity
        self._hold_at = float(FOREVER)  # tick, with its fraction, without another setpoint
        self._held = False  # the axes stand since then
        self._called = 0  # tick of the last setpoint
        self._fed = False  # there was one since the stream began
        self._watching = False

    def begin(self, axis: int, *, by_velocity: bool = False) -> None:
        """``axis`` follows from now on; until the first setpoint its velocity stays."""
        servo, tick = self._world.servo, self._world.tick
        if not self._followers:
            self.end, self._fed = float(tick), False
            self._hold_at, self._held = float(FOREVER), False
            self._world.lapse = FOREVER
        position, speed = float(servo.command[axis]), float(servo.command_velocity[axis])
        servo.follow(axis, tick, position, speed, 0.0)
        # Others that follow have a setpoint that is still due: where this axis is by then.
        self.position[axis] = position + speed * (self.end - tick) * servo.tick_s
        self.velocity[axis] = speed
        self.following[axis], self.by_velocity[axis] = True, by_velocity
        self._take_stock()
        self._called = tick
        self._watch()

    def drop(self, axis: int) -> None:
        """``axis`` follows no more."""
        if self.following[axis]:
            self.following[axis] = False
            self._take_stock()

    def setpoint(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        """Take one setpoint per axis, shape (n,); ignored for axes that do not stream.

        Raises LateSetpoint when less than half a period is left until ``due_ns``.
        """
        if not self._followers:
            return
        tick, servo, end = self._world.tick, self._world.servo, self._world.tick_of(due_ns)
        if end - tick < self._period / 2:
            raise LateSetpoint
        if self._world.tick_of(self._world.clock.now_ns()) > self._hold_at:
            self._hold()  # within this tick
        held, self._held = self._held, False
        self._called, self._fed, self.end = tick, True, end
        self._hold_at = end + EXTRAPOLATION_PERIODS * self._period
        self._world.lapse, self._world.on_lapse = floor(self.end), self._go_on
        time_s = (self.end - tick) * servo.tick_s
        targets, ends = position.tolist(), velocity.tolist()
        _, starts, speeds, _ = servo.state()
        for axis, by_velocity in self._followers:
            start, speed, end = starts[axis], speeds[axis], ends[axis]
            if held and not by_velocity:
                start, speed = self.position[axis], 0.0
            displacement = (speed + end) / 2 * time_s if by_velocity else targets[axis] - start
            self.position[axis], self.velocity[axis] = start + displacement, end
            mean = displacement / time_s
            acceleration = 2 * (3 * mean - 2 * speed - end) / time_s
            jerk = 6 * (speed + end - 2 * mean) / time_s**2
            servo.follow(axis, tick, start, speed, acceleration, jerk)

    def _go_on(self) -> None:
        """The setpoint is reached: keep its velocity for a time."""
        world, tick = self._world, self._world.tick
        past_s = (tick - self.end) * world.servo.tick_s
        for axis, _ in self._followers:
            position, velocity = self.position[axis], self.velocity[axis]
            world.servo.follow(axis, tick, position + velocity * past_s, velocity, 0.0)
        world.lapse = max(tick, floor(self._hold_at))
        world.on_lapse = self._hold

    def _hold(self) -> None:
        """Setpoints are missing: the axes stand where the last one has led them."""
        if self._held:
            return
        self._held = True
        past_s = (self._hold_at - self.end) * self._world.servo.tick_s
        for axis, by_velocity in self._followers:
            if not by_velocity:
                self.position[axis] += self.velocity[axis] * past_s
                self.velocity[axis] = 0.0
                self._world.servo.follow(axis, self._world.tick, self.position[axis], 0.0, 0.0)

    def _take_stock(self) -> None:
        self._followers = [
            (axis, bool(self.by_velocity[axis])) for axis in np.flatnonzero(self.following).tolist()
        ]

    def _watch(self) -> None:
        if not self._watching:
            self._watching = True
            self._world.at(self._called + self._timeout, self._expire)

    def _expire(self) -> None:
        self._watching = False
        if not self.following.any():
            return
        waiting = not self._fed and not any(self.velocity[axis] for axis, _ in self._followers)
        if self._world.tick - self._called >= self._timeout and not waiting:
            self._on_timeout()
        else:
            self._watch()
