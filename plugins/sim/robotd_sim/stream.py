"""Streamed setpoints: a cubic through position and velocity, on an even grid of time."""

from __future__ import annotations

from collections.abc import Callable
from math import floor

import numpy as np

from robotd.plugin.api import FloatArray
from robotd_sim.state import Flags
from robotd_sim.world import World


class Stream:
    """Setpoints of the axes in ``following``, each to be reached one period after its call.

    Between two setpoints the command is the cubic that continues position and velocity, and
    ends in the setpoint's; for an axis in ``by_velocity``, whose position follows from even
    acceleration to the velocity, it is a parabola. Calls that come a little early or late (up
    to half a period) still aim at the ends of an even grid, so that the caller's jitter does
    not shake the axis. When a setpoint is overdue the command goes on with the last velocity;
    after ``timeout`` ticks ``on_timeout`` is called, unless the axes stand and still wait for
    the first setpoint.
    """

    def __init__(
        self, world: World, period_s: float, timeout: int, on_timeout: Callable[[], None]
    ) -> None:
        axes = world.servo.axes
        self.following: Flags = np.zeros(axes, bool)
        self.by_velocity: Flags = np.zeros(axes, bool)
        self.position: FloatArray = np.zeros(axes)  # the last setpoint
        self.velocity: FloatArray = np.zeros(axes)
        self.end = 0.0  # tick, with its fraction, at which the last setpoint is due
        self._world, self._timeout, self._on_timeout = world, timeout, on_timeout
        self._period = period_s / world.servo.tick_s
        self._called = 0  # tick of the last setpoint
        self._fed = False  # there was one since the stream began
        self._watching = False

    def begin(self, axis: int, *, by_velocity: bool = False) -> None:
        """``axis`` follows from now on; until the first setpoint its velocity stays."""
        servo = self._world.servo
        self.by_velocity[axis] = by_velocity
        self.position[axis], self.velocity[axis] = servo.command[axis], servo.command_velocity[axis]
        servo.follow(axis, self._world.tick, self.position[axis], self.velocity[axis], 0.0)
        self.following[axis] = True
        self.end = float(self._world.tick)
        self._called, self._fed = self._world.tick, False
        self._watch()

    def setpoint(self, position: FloatArray, velocity: FloatArray) -> None:
        """One setpoint per axis, of shape (n,); entries of axes that do not follow are ignored."""
        tick, servo, mask = self._world.tick, self._world.servo, self.following
        self._called, self._fed = tick, True
        late = abs(self.end - tick) > self._period / 2
        self.end = (tick if late else self.end) + self._period
        time_s = (self.end - tick) * servo.tick_s
        np.copyto(self.position, position, where=mask)
        np.copyto(self.velocity, velocity, where=mask)
        start, speed = servo.command, servo.command_velocity
        np.copyto(
            self.position,
            start + (speed + self.velocity) * (time_s / 2),
            where=mask & self.by_velocity,
        )
        mean = (self.position - start) / time_s
        servo.rebase(tick)
        for row, value in zip(
            servo.coefficients,
            (
                start,
                speed,
                (3 * mean - 2 * speed - self.velocity) / time_s,
                (speed + self.velocity - 2 * mean) / time_s**2,
            ),
            strict=True,
        ):
            np.copyto(row, value, where=mask)
        end = self.end
        if floor(end) <= tick:
            self._go_on(end)
        else:
            self._world.at(floor(end), lambda: self._go_on(end))

    def _go_on(self, end: float) -> None:
        """The setpoint is reached: keep its velocity until there is another."""
        if end != self.end:
            return
        servo, mask = self._world.servo, self.following
        servo.rebase(self._world.tick)
        past_s = (self._world.tick - end) * servo.tick_s
        np.copyto(servo.coefficients[0], self.position + self.velocity * past_s, where=mask)
        np.copyto(servo.coefficients[1], self.velocity, where=mask)
        np.copyto(servo.coefficients[2:], 0.0, where=mask)

    def _watch(self) -> None:
        if not self._watching:
            self._watching = True
            self._world.at(self._called + self._timeout, self._expire)

    def _expire(self) -> None:
        self._watching = False
        if not self.following.any():
            return
        waiting = not self._fed and not self.velocity[self.following].any()
        if self._world.tick - self._called >= self._timeout and not waiting:
            self._on_timeout()
        else:
            self._watch()
