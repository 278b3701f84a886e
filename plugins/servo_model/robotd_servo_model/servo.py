"""Command and response of all axes, tick by tick.

Command: between events each axis' command is a polynomial of time, p + v·t + h·t² + j·t³.

Response: the drive joins the commands of two ticks by a straight line (CSP) and its position
loop follows as a first-order lag with velocity feed-forward,

    τ·y' = c + f·τ·c' − y,    τ = 1 / (2π · bandwidth),

whose exact solution over one tick is a weighted sum of c₀, y₀ and c₁ (see ``_response``).
In a steady ramp the following error is (1−f)·τ·c'.

Computed in plain floats: a robot has few axes, and the control loop comes out of a sleep. For six
axes both ways take 2 µs a tick in a tight loop; after a sleep of 2 ms NumPy takes 25, this takes 9.

Nothing here locks: ``ServoWorld`` does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robotd.api import FloatArray

_SETTLED = 1e-15  # part of a following error that may vanish when an axis comes to rest
_STICTION_RAD_S = 0.01  # below this speed, friction grows linearly: its sign must not flicker


@dataclass(frozen=True)
class Mechanics:
    """Constants of the axes, each of shape (n_axes,)."""

    bandwidth_hz: FloatArray
    feedforward: FloatArray
    inertia_kg_m2: FloatArray
    viscous_friction_nm_s: FloatArray
    coulomb_friction_nm: FloatArray


_Path = tuple[int, float, float, float, float]
"""Command of one axis: tick, position and velocity there, acceleration / 2, jerk / 6.

No NamedTuple, which takes ten times as long to make, for each axis in each period.
"""


class _Loop(NamedTuple):
    """Response of one axis: weights of c₀, y₀ and c₁, and constants of its measurement."""

    of_before: float = 0.0
    of_position: float = 0.0
    of_command: float = 0.0
    gain: float = 0.0  # 1/τ
    feedforward: float = 0.0
    inertia: float = 0.0
    viscous: float = 0.0
    friction: float = 0.0  # torque per speed, up to ``_STICTION_RAD_S``


_HELD = _Loop(of_position=1.0)
_COASTING = _Loop(of_command=1.0, feedforward=1.0)  # it is its own command


class Servo:
    """State of n axes in their user units.

    Attributes:
        position, command, command_velocity, command_acceleration: views, shape (n,).
        watched: the first two of them as one view, shape (2, n).
        settle_ticks: how long the slowest axis needs to come to rest after its command.
    """

    def __init__(self, mechanics: Mechanics, tick_s: float) -> None:
        axes = len(mechanics.bandwidth_hz)
        self.axes, self.tick_s = axes, tick_s
        self._mechanics = mechanics
        self._gain = 2 * math.pi * mechanics.bandwidth_hz
        self.settle_ticks = math.ceil(-math.log(_SETTLED) / self._gain.min() / tick_s) + 1
        self._state: FloatArray = np.zeros((4, axes))
        self.position, self.command, self.command_velocity, self.command_acceleration = self._state
        self.watched = self._state[:2]  # measured and commanded position
        self._cells = self._state.data.cast("B").cast("d")  # the quick way to single numbers
        self._paths: list[_Path] = [(0, 0.0, 0.0, 0.0, 0.0)] * axes
        self._loops = [_COASTING] * axes
        self._rests = False
        self._changes = 0  # of what an axis measures in the same state
        self._closed, self._free = [False] * axes, np.ones(axes, bool)

    def run(self, tick: int, stop: int, check: Callable[[], bool] | None) -> tuple[int, bool]:
        """Step from ``tick`` to ``stop``, or to the first tick at which ``check`` is True."""
        if check is None:
            self._live(tick, stop)
            return stop, False
        for now in range(tick + 1, stop + 1):
            self._live(now - 1, now)
            if check():
                return now, True
        return stop, False

    def rest(self) -> None:
        """Clear the remainders of motion: all axes are at rest."""
        if self._rests:
            return
        self._rests = True
        np.copyto(self.position, self.command, where=self._free)
        self._state[2:] = 0.0
        self._paths = [(0, command, 0.0, 0.0, 0.0) for command in self.command.tolist()]

    def follow(
        self,
        axis: int,
        tick: int,
        position: float,
        velocity: float,
        acceleration: float,
        jerk: float = 0.0,
    ) -> None:
        """Follow a path of constant ``jerk`` that is at ``position`` at ``tick``."""
        self._paths[axis] = tick, position, velocity, acceleration / 2, jerk / 6

    def close_loop(self, axis: int, *, closed: bool) -> None:
        """Position loop on, or off: the axis then is its own command (it coasts)."""
        self._closed[axis] = closed
        self._changes += 1
        self._rests = False
        if not self._free[axis]:
            self._loops[axis] = _HELD
        else:
            self._loops[axis] = self._closed_loop(axis) if closed else _COASTING

    def grip(self, axis: int, *, held: bool) -> None:
        """Something outside holds the axis where it is, whatever is commanded; or lets it go."""
        self._free[axis] = not held
        self.close_loop(axis, closed=self._closed[axis])

    def lead(self, axis: int, velocity: float) -> float:
        """Return the distance by which a steady command of ``velocity`` leads the response."""
        return (1 - float(self._mechanics.feedforward[axis])) * velocity / float(self._gain[axis])

    def place(self, axis: int, position: float, command: float, velocity: float) -> None:
        """Set the present state of one axis, outside of any dynamics."""
        self._state[:, axis] = position, command, velocity, 0.0
        self._rests = False

    def velocity(self, axis: int) -> float:
        """Measured velocity of one axis."""
        return self.measure(self.state())[0][axis]

    def state(self) -> list[list[float]]:
        """Return (4, n): measured positions; commanded positions, velocities, accelerations."""
        state: list[list[float]] = self._state.tolist()
        return state

    def measure(self, state: list[list[float]]) -> tuple[list[float], list[float]]:
        """Measured velocities of all axes in ``state``, and torques of their motors.

        By the lag's equation y' = (c − y)/τ + f·c', and the torque by its derivative.
        """
        velocities, torques = [], []
        for y, c, speed, acceleration, loop in zip(*state, self._loops, strict=True):
            _, _, _, gain, forward, inertia, viscous, friction = loop
            velocity = gain * (c - y) + forward * speed
            slip = velocity
            if abs(slip) > _STICTION_RAD_S:
                slip = math.copysign(_STICTION_RAD_S, slip)
            change = gain * (speed - velocity) + forward * acceleration
            velocities.append(velocity)
            torques.append(inertia * change + viscous * velocity + friction * slip)
        return velocities, torques

    def snapshot(self) -> tuple[int, bytes]:
        """Equals another one if every axis would measure the same now as then."""
        return self._changes, self._state.tobytes()

    def relabel(self, scale: FloatArray, shift: FloatArray) -> None:
        """Change the units: every position becomes position · scale + shift."""
        self._changes += 1
        self._state *= scale
        self._state[:2] += shift
        for axis, (factor, summand) in enumerate(zip(scale.tolist(), shift.tolist(), strict=True)):
            origin, position, *others = self._paths[axis]
            velocity, half_acceleration, sixth_jerk = (factor * other for other in others)
            position = position * factor + summand
            self._paths[axis] = origin, position, velocity, half_acceleration, sixth_jerk

    def _live(self, tick: int, stop: int) -> None:
        """Step from ``tick`` to ``stop``, axis by axis."""
        self._rests = False
        axes, tick_s, cells = self.axes, self.tick_s, self._cells
        for axis, (path, loop) in enumerate(zip(self._paths, self._loops, strict=True)):
            origin, p, v, h, j = path
            of_before, of_position, of_command = loop[:3]
            position, command, t = cells[axis], cells[axes + axis], 0.0
            for elapsed in range(tick + 1 - origin, stop + 1 - origin):
                before, t = command, elapsed * tick_s
                command = p + t * (v + t * (h + t * j))
                position = of_before * before + of_position * position + of_command * command
            cells[axis], cells[axes + axis] = position, command
            cells[2 * axes + axis] = v + t * (2 * h + t * 3 * j)
            cells[3 * axes + axis] = 2 * h + t * 6 * j

    def _closed_loop(self, axis: int) -> _Loop:
        mechanics = self._mechanics
        gain, forward = float(self._gain[axis]), float(mechanics.feedforward[axis])
        return _Loop(
            *_response(gain * self.tick_s, forward),
            gain,
            forward,
            float(mechanics.inertia_kg_m2[axis]),
            float(mechanics.viscous_friction_nm_s[axis]),
            float(mechanics.coulomb_friction_nm[axis]) / _STICTION_RAD_S,
        )


def _response(step: float, forward: float) -> tuple[float, float, float]:
    """Weights of c₀, y₀ and c₁ in y₁; ``step`` is dt/τ, ``forward`` the feed-forward f.

    Over a tick c = c₀ + m·t, and the lag's solution is y = c + (f−1)·τ·m + K·exp(−t/τ) with K
    from y(0) = y₀; m = (c₁ − c₀)/dt sorts the terms.
    """
    decay = math.exp(-step)
    slope = (1 - decay) * (forward - 1) / step
    return -slope - decay, decay, 1 + slope
