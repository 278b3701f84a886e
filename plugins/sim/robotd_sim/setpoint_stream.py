"""Streamed setpoints: a cubic through position and velocity, up to the due time."""

from __future__ import annotations

from collections.abc import Callable
from math import floor

import numpy as np

from robotd.api import FloatArray, LateSetpoint
from robotd_servo_model.world import FOREVER, World
from robotd_sim.axis_states import Flags


class Stream:
    """Setpoints of the axes in ``following``, each to be reached at its due time.

    Between two setpoints the command is the cubic that continues position and velocity, and
    ends in the setpoint's; for an axis in ``by_velocity``, whose position follows from even
    acceleration to the velocity, it is a parabola. When a setpoint is overdue the command
    continues with the last velocity; one that arrives with less than half a period left is
    rejected, for the axes could reach it only by a jump. After ``timeout`` ticks ``on_timeout``
    is called, unless the axes are at rest and still wait for the first setpoint.
    """

    def __init__(
        self, world: World, period_s: float, timeout: int, on_timeout: Callable[[], None]
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
        self._called = 0  # tick of the last setpoint
        self._fed = False  # there was one since the stream began
        self._watching = False
        world.on_lapse = self._go_on

    def begin(self, axis: int, *, by_velocity: bool = False) -> None:
        """``axis`` follows from now on; until the first setpoint its velocity stays."""
        servo = self._world.servo
        _, commands, speeds, _ = servo.state()
        self.position[axis], self.velocity[axis] = commands[axis], speeds[axis]
        servo.follow(axis, self._world.tick, *self._setpoint(axis), 0.0)
        self.following[axis], self.by_velocity[axis] = True, by_velocity
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

    def setpoint(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        """Take one setpoint per axis, shape (n,); ignored for axes that do not stream.

        Raises LateSetpoint when less than half a period is left until ``due_ns``.
        """
        if not self._followers:
            return
        tick, servo, end = self._world.tick, self._world.servo, self._world.tick_of(due_ns)
        if end - tick < self._period / 2:
            raise LateSetpoint
        self._called, self._fed, self.end = tick, True, end
        self._world.lapse = floor(self.end)
        time_s = (self.end - tick) * servo.tick_s
        targets, ends = position.tolist(), velocity.tolist()
        _, starts, speeds, _ = servo.state()
        for axis, by_velocity in self._followers:
            start, speed, end = starts[axis], speeds[axis], ends[axis]
            way = (speed + end) / 2 * time_s if by_velocity else targets[axis] - start
            self.position[axis], self.velocity[axis] = start + way, end
            mean = way / time_s
            acceleration = 2 * (3 * mean - 2 * speed - end) / time_s
            jerk = 6 * (speed + end - 2 * mean) / time_s**2
            servo.follow(axis, tick, start, speed, acceleration, jerk)

    def _go_on(self) -> None:
        """The setpoint is reached: keep its velocity until there is another."""
        past_s = (self._world.tick - self.end) * self._world.servo.tick_s
        for axis, _ in self._followers:
            position, velocity = self._setpoint(axis)
            self._world.servo.follow(
                axis, self._world.tick, position + velocity * past_s, velocity, 0.0
            )

    def _setpoint(self, axis: int) -> tuple[float, float]:
        return self.position[axis], self.velocity[axis]

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
