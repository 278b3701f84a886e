"""Streamed setpoints: a cubic through position and velocity, on an even grid of time."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import floor

import numpy as np

from robotd.plugin.api import FloatArray
from robotd_sim.state import Flags
from robotd_sim.world import FOREVER, World


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
        self._ends: FloatArray = np.zeros((3, axes))  # speed now, way to go, speed at the end
        self.velocity = self._ends[2]  # of the last setpoint
        self._bent: FloatArray = np.zeros((2, axes))
        self._mask: Flags | bool = False  # ``following``, or whether all do
        self._turns = False  # somebody follows by velocity
        self.end = 0.0  # tick, with its fraction, at which the last setpoint is due
        self._world, self._timeout, self._on_timeout = world, timeout, on_timeout
        self._period = period_s / world.servo.tick_s
        self._called = 0  # tick of the last setpoint
        self._fed = False  # there was one since the stream began
        self._watching = False
        world.on_lapse = self._go_on

    def begin(self, axis: int, *, by_velocity: bool = False) -> None:
        """``axis`` follows from now on; until the first setpoint its velocity stays."""
        servo = self._world.servo
        self.by_velocity[axis] = by_velocity
        self.position[axis], self.velocity[axis] = servo.command[axis], servo.command_velocity[axis]
        servo.follow(axis, self._world.tick, self.position[axis], self.velocity[axis], 0.0)
        self.following[axis] = True
        self._take_stock()
        self.end = float(self._world.tick)
        self._world.lapse = FOREVER
        self._called, self._fed = self._world.tick, False
        self._watch()

    def drop(self, axis: int) -> None:
        """``axis`` follows no more."""
        if self.following[axis]:
            self.following[axis] = False
            self._take_stock()

    def setpoint(self, position: FloatArray, velocity: FloatArray) -> None:
        """One setpoint per axis, of shape (n,); entries of axes that do not follow are ignored."""
        tick, servo, mask = self._world.tick, self._world.servo, self._mask
        if mask is False:
            return
        self._called, self._fed = tick, True
        late = abs(self.end - tick) > self._period / 2
        self.end = (tick if late else self.end) + self._period
        self._world.lapse = floor(self.end)
        time_s = (self.end - tick) * servo.tick_s
        np.copyto(self.position, position, where=mask)
        np.copyto(self.velocity, velocity, where=mask)
        speed, way, _ = self._ends
        speed[:] = servo.command_velocity
        np.subtract(self.position, servo.command, way)
        if self._turns:
            turning = self.following & self.by_velocity
            np.copyto(way, (speed + self.velocity) * (time_s / 2), where=turning)
            np.add(servo.command, way, self.position, where=turning)
        np.dot(_bend(time_s), self._ends, self._bent)
        servo.take_over(tick, self._bent, mask)

    def _go_on(self) -> None:
        """The setpoint is reached: keep its velocity until there is another."""
        servo, mask = self._world.servo, self.following
        servo.rebase(self._world.tick)
        past_s = (self._world.tick - self.end) * servo.tick_s
        np.copyto(servo.coefficients[0], self.position + self.velocity * past_s, where=mask)
        np.copyto(servo.coefficients[1], self.velocity, where=mask)
        np.copyto(servo.coefficients[2:], 0.0, where=mask)

    def _take_stock(self) -> None:
        following = self.following
        self._mask = bool(following.any()) and (bool(following.all()) or following)
        self._turns = bool((following & self.by_velocity).any())

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


@lru_cache(maxsize=64)  # the same few times again and again: periods are whole ticks, or nearly
def _bend(time_s: float) -> FloatArray:
    """(2, 3): h and j of p + v·t + h·t² + j·t³ from v, the way after ``time_s``, and v then."""
    t = time_s
    return np.array([[-2 / t, 3 / t**2, -1 / t], [1 / t**2, -2 / t**3, 1 / t**2]])
