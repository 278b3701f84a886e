"""Motors of all simulated drives: the shared servo model in the time of the drives.

While SYNC comes, the drives' clocks are locked to it: one SYNC is one period whatever the
jitter of the frame, as the phase-locked loop of a drive does it. Without SYNC they run on
the clock of the computer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import ceil, floor

import numpy as np

from robotd.api import NANOSECONDS, FloatArray, Segment
from robotd_cia402.sync_timing import SyncTiming
from robotd_servo_model import FOREVER, Mechanics, Servo, ServoWorld

TICK_S = 0.001
_MAX_CATCH_UP_S = 1.0


class DriveClock:
    """Clock that is set from outside."""

    def __init__(self, now_ns: int) -> None:
        self._now_ns = now_ns

    def now_ns(self) -> int:
        return self._now_ns

    def set(self, now_ns: int) -> None:
        self._now_ns = max(self._now_ns, now_ns)

    def sleep_until_ns(self, deadline_ns: int) -> None:
        self.set(deadline_ns)


class Motors:
    """n motors in rad (or m); used by the thread of the simulated network alone.

    Args:
        initial: position of each at power-on.
        now_ns: present time.
        weights: returns the torques (n,) that carry what hangs on them at positions (n,), N·m or N;
            None: nothing does.

    Attributes:
        servo: commands and responses of all motors.
    """

    def __init__(
        self,
        initial: Sequence[float],
        now_ns: int,
        weights: Callable[[FloatArray], FloatArray] | None = None,
    ) -> None:
        axes = max(1, len(initial))
        self._mechanics = _mechanics(axes)
        self.servo = Servo(self._mechanics, TICK_S)
        self._clock = DriveClock(now_ns)
        self._timing = SyncTiming(round(TICK_S * NANOSECONDS), now_ns)
        self._runs_free = True
        self._world = ServoWorld(self._clock, self.servo, _MAX_CATCH_UP_S)
        self._plans = [0] * axes
        self._weights, self._weight = weights, np.zeros(axes)
        self._measure()
        for axis, position in enumerate(initial):
            self.servo.place(axis, position, position, 0.0)
            self._follow(axis, Segment(0.0, position, 0.0, 0.0))

    def synchronise(self, now_ns: int, period_s: float) -> None:
        """Advance by a SYNC at ``now_ns``: one period, more if SYNCs were lost, or none.

        The first one after a time without SYNC ends that time, and begins the grid anew.
        """
        self._timing.period_ns = round(period_s * NANOSECONDS)
        if self._runs_free:
            self.free_run(now_ns)
            self._runs_free = False
        else:
            self._advance(self._timing.note_event(now_ns) * self._timing.period_ns)

    def free_run(self, now_ns: int) -> None:
        """Advance to ``now_ns`` without SYNC."""
        elapsed_ns = now_ns - self._timing.time_ns
        self._runs_free = True
        self._timing.begin(now_ns)
        self._advance(elapsed_ns)

    def position(self, axis: int) -> float:
        return float(self.servo.position[axis])

    def command(self, axis: int) -> tuple[float, float]:
        """Commanded position and velocity."""
        return float(self.servo.command[axis]), float(self.servo.command_velocity[axis])

    def velocity(self, axis: int) -> float:
        return float(self._velocity[axis])

    def torque(self, axis: int) -> float:
        return float(self._torque[axis] + self._weight[axis])

    def moves(self, axis: int) -> bool:
        """Return True while the command of ``axis`` moves."""
        return self._world.moves(axis)

    def enable(self, axis: int) -> None:
        """Position loop on, at the measured position: nothing jumps."""
        self.servo.close_loop(axis, closed=True)
        self.hold(axis, self.position(axis))
        self.servo.place(axis, self.position(axis), self.position(axis), 0.0)

    def disable(self, axis: int) -> None:
        """Position loop off: friction brakes the motor."""
        speed = self.velocity(axis)
        self.servo.close_loop(axis, closed=False)
        position = self.position(axis)
        self.servo.place(axis, position, position, speed)
        deceleration = 10.0
        stop_s = abs(speed) / deceleration
        end = position + 0.5 * speed * stop_s
        slow = Segment(0.0, position, speed, -float(np.sign(speed)) * deceleration)
        self.plan(axis, [slow, Segment(stop_s, end, 0.0, 0.0)] if stop_s else [slow])

    def hold(self, axis: int, position: float) -> None:
        """Hold ``position``."""
        self.plan(axis, [Segment(0.0, position, 0.0, 0.0)])

    def push(self, axis: int, torque: float, period_s: float) -> None:
        """Accelerate with ``torque`` (N·m or N) for a period; then keep the speed.

        The model has inertia and friction of one motor, and its weight. It has no other joints and
        no limit of the torque, and the position loop stays closed: the motor follows with its lag.
        """
        torque -= float(self._weight[axis])
        position, velocity = self.command(axis)
        mechanics = self._mechanics
        coulomb = float(mechanics.coulomb_friction_nm[axis])
        if velocity == 0.0 and abs(torque) <= coulomb:
            self.hold(axis, position)
            return
        direction = velocity or torque
        friction = float(np.sign(direction)) * coulomb
        viscous = float(mechanics.viscous_friction_nm_s[axis]) * velocity
        change = (torque - friction - viscous) / float(mechanics.inertia_kg_m2[axis])
        speed = velocity + change * period_s
        if velocity * speed < 0.0:  # friction stops it; it starts anew in the next period
            speed = 0.0
            change = -velocity / period_s
        end = position + 0.5 * (velocity + speed) * period_s
        self.plan(
            axis, [Segment(0.0, position, velocity, change), Segment(period_s, end, speed, 0.0)]
        )

    def keep(self, axis: int, position: float) -> None:
        """Hold the motor at ``position`` from outside, at rest, whatever the command."""
        self.servo.place(axis, position, *self.command(axis))
        self._velocity[axis] = 0.0  # the lag's is that towards the command

    def plan(
        self, axis: int, segments: Sequence[Segment], then: Callable[[], None] | None = None
    ) -> None:
        """Follow ``segments`` from now on, and call ``then`` when the last one begins.

        A segment is loaded at the last tick before it begins, so that the next tick lies on it.
        """
        self._plans[axis] += 1
        number, begun = self._plans[axis], self._world.tick

        def load(segment: Segment) -> None:
            if number == self._plans[axis]:
                now = self._world.tick
                position, velocity = segment.at((now - begun) * TICK_S)
                self.servo.follow(axis, now, position, velocity, segment.acceleration)

        for segment in segments:
            first = floor(segment.start_s / TICK_S + 1e-9)
            if first == 0:
                load(segment)
            else:
                self._world.at(begun + first, partial(load, segment))
        last = segments[-1]
        if last.velocity or last.acceleration:
            self._world.busy(axis, FOREVER)
            return
        ended = begun + ceil(last.start_s / TICK_S - 1e-6)
        self._world.busy(axis, ended)
        if then is not None:
            done = then
            self._world.at(ended, lambda: done() if number == self._plans[axis] else None)

    def _follow(self, axis: int, segment: Segment) -> None:
        self.servo.follow(axis, self._world.tick, segment.position, 0.0, 0.0)

    def _advance(self, elapsed_ns: int) -> None:
        self._clock.set(self._clock.now_ns() + elapsed_ns)
        self._world.advance()
        self._measure()

    def _measure(self) -> None:
        self._velocity, self._torque = self.servo.measure(self.servo.state())
        if self._weights is not None:
            self._weight = self._weights(self.servo.position)


def _mechanics(axes: int) -> Mechanics:
    """Return the defaults of the simulation backend."""
    return Mechanics(
        bandwidth_hz=np.full(axes, 50.0),
        feedforward=np.full(axes, 0.9),
        inertia_kg_m2=np.full(axes, 0.5),
        viscous_friction_nm_s=np.full(axes, 1.0),
        coulomb_friction_nm=np.full(axes, 2.0),
    )
