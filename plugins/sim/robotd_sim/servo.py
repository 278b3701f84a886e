"""Command and response of all axes, tick by tick, in five calls of NumPy a tick.

Command: between events each axis' command is a polynomial of time, p + v·t + h·t² + j·t³, so
one product of a (3, 4) basis with the (4, n) coefficients gives position, velocity and
acceleration of all axes.

Response: the drive joins the commands of two ticks by a straight line (CSP) and its position
loop follows as a first-order lag with velocity feed-forward,

    τ·y' = c + f·τ·c' − y,    τ = 1 / (2π · bandwidth),

whose exact solution over one tick is a weighted sum of c₀, y₀ and c₁ (see ``_response``).
In a steady ramp the following error is (1−f)·τ·c'.

Nothing here locks: ``World`` does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robotd.plugin.api import FloatArray

_SPAN = 64  # ticks that a polynomial is followed before its origin moves; keeps t small
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


class Servo:
    """State of n axes in their user units; rows of ``_state``: c₀, y, c, c', c''.

    Attributes:
        position, command, command_velocity, command_acceleration: views, shape (n,).
        watched: the first two of them as one view, shape (2, n).
        commands: commanded position and velocity as one view, shape (2, n).
        coefficients: p, v, h, j about the tick ``origin``, shape (4, n).
        settle_ticks: how long the slowest axis needs to come to rest after its command.
    """

    def __init__(self, mechanics: Mechanics, tick_s: float) -> None:
        axes = len(mechanics.bandwidth_hz)
        self.axes, self.tick_s, self.origin = axes, tick_s, 0
        self._mechanics = mechanics
        self._gain = 2 * math.pi * mechanics.bandwidth_hz
        self.settle_ticks = math.ceil(-math.log(_SETTLED) / self._gain.min() / tick_s) + 1
        self._state: FloatArray = np.zeros((5, axes))
        self._before, self.position, self.command = self._state[0], self._state[1], self._state[2]
        self.command_velocity, self.command_acceleration = self._state[3], self._state[4]
        self._filtered, self._commanded = self._state[:3], self._state[2:]
        self.watched = self._state[1:3]  # measured and commanded position
        self.commands = self._state[2:4]
        self.coefficients: FloatArray = np.zeros((4, axes))
        self._bases = [_basis(tick_s * count) for count in range(_SPAN + 1)]
        self._shifts = [_shift(tick_s * count) for count in range(_SPAN + 1)]
        self._weights: FloatArray = np.zeros((3, axes))
        self._terms: FloatArray = np.zeros((3, axes))
        # What is measured is a weighted sum of y, c, c' and c''.
        self._readings: FloatArray = np.zeros((2, 4, axes))
        self._speed, self._torque = self._readings
        self._products: FloatArray = np.zeros((2, 4, axes))
        self._friction: FloatArray = np.zeros(axes)
        self._rests = False
        self._changes = 0  # of what an axis measures in the same state
        self._closed, self._free = [False] * axes, np.ones(axes, bool)
        for axis in range(axes):
            self.close_loop(axis, closed=False)

    def run(self, tick: int, stop: int, check: Callable[[], bool] | None) -> tuple[int, bool]:
        """Step from ``tick`` to ``stop``, or to the first tick at which ``check`` says True."""
        before, command, commanded, coefficients = (
            self._before, self.command, self._commanded, self.coefficients)  # fmt: skip
        weights, filtered, terms, position = (
            self._weights, self._filtered, self._terms, self.position)  # fmt: skip
        of_before, of_position, of_command = terms
        self._rests = False
        for now in range(tick + 1, stop + 1):
            if now - self.origin > _SPAN:
                self.rebase(now - 1)
            before[:] = command
            np.dot(self._bases[now - self.origin], coefficients, commanded)
            np.multiply(weights, filtered, terms)
            np.add(of_before, of_position, position)  # of three rows faster than ``add.reduce``
            np.add(position, of_command, position)
            if check is not None and check():
                return now, True
        return stop, False

    def rest(self, tick: int) -> None:
        """All axes stand: jump to ``tick`` and let the last remainders of motion vanish."""
        self.origin = tick
        if self._rests:
            return
        self._rests = True
        self.coefficients[0] = self._before[:] = self.command
        np.copyto(self.position, self.command, where=self._free)
        self.coefficients[1:] = 0.0
        self._state[3:] = 0.0

    def rebase(self, tick: int) -> None:
        """Move the origin of every polynomial to ``tick``; the motion stays the same."""
        if tick != self.origin:
            self.coefficients[:] = self._shifts[tick - self.origin] @ self.coefficients
            self.origin = tick

    def take_over(self, tick: int, bent: FloatArray, where: NDArray[np.bool_] | bool) -> None:
        """Go on from the command of the present ``tick`` with the h and j of ``bent``, (2, n)."""
        if where is True:
            self.origin = tick
        else:
            self.rebase(tick)
        np.copyto(self.coefficients[:2], self.commands, where=where)
        np.copyto(self.coefficients[2:], bent, where=where)

    def follow(
        self, axis: int, tick: int, position: float, velocity: float, acceleration: float
    ) -> None:
        """From ``tick``, where the command shall be at ``position``, accelerate constantly."""
        self.rebase(tick)
        self.coefficients[:, axis] = position, velocity, 0.5 * acceleration, 0.0

    def close_loop(self, axis: int, *, closed: bool) -> None:
        """Position loop on, or off: the axis then is its own command (it coasts)."""
        gain, forward = float(self._gain[axis]), float(self._mechanics.feedforward[axis])
        self._closed[axis] = closed
        self._changes += 1
        if not self._free[axis]:
            self._weights[:, axis] = 0.0, 1.0, 0.0
            self._speed[:, axis] = self._torque[:, axis] = self._friction[axis] = 0.0
            return
        if not closed:
            self._weights[:, axis] = 0.0, 0.0, 1.0  # rows c₀, y, c
            self._speed[:, axis] = 0.0, 0.0, 1.0, 0.0
            self._torque[:, axis] = 0.0
            self._friction[axis] = 0.0
            return
        self._weights[:, axis] = _response(gain * self.tick_s, forward)
        speed = np.array([-gain, gain, forward, 0.0])
        change = np.array([gain**2, -(gain**2), gain * (1 - forward), forward])
        inertia = self._mechanics.inertia_kg_m2[axis]
        self._speed[:, axis] = speed
        self._torque[:, axis] = (
            inertia * change + self._mechanics.viscous_friction_nm_s[axis] * speed
        )
        self._friction[axis] = self._mechanics.coulomb_friction_nm[axis] / _STICTION_RAD_S

    def grip(self, axis: int, *, held: bool) -> None:
        """Something outside holds the axis where it is, whatever is commanded; or lets it go."""
        self._free[axis] = not held
        self.close_loop(axis, closed=self._closed[axis])

    def lead(self, axis: int, velocity: float) -> float:
        """How far a steady command of ``velocity`` runs ahead of the closed loop."""
        return (1 - float(self._mechanics.feedforward[axis])) * velocity / float(self._gain[axis])

    def place(self, axis: int, position: float, command: float, velocity: float) -> None:
        """Set the present state of one axis, outside of any dynamics."""
        self._state[:, axis] = command, position, command, velocity, 0.0
        self._rests = False

    def velocity(self, axis: int) -> float:
        """Measured velocity of one axis."""
        return float(self._speed[:, axis] @ self._state[1:, axis])

    def measure(self, out: FloatArray) -> None:
        """Measured velocities and torques of the motors into the two rows of ``out``, (2, n)."""
        np.multiply(self._readings, self._state[1:], self._products)
        np.add.reduce(self._products, 1, out=out)
        velocity, torque = out
        slip = self._terms[0]
        np.maximum(velocity, -_STICTION_RAD_S, out=slip)
        np.minimum(slip, _STICTION_RAD_S, out=slip)
        np.multiply(slip, self._friction, slip)
        np.add(torque, slip, torque)

    def snapshot(self) -> tuple[int, bytes]:
        """Equals another one if every axis would measure the same now as then."""
        return self._changes, self._state.tobytes()

    def relabel(self, scale: FloatArray, shift: FloatArray) -> None:
        """Change the units: every position becomes position · scale + shift."""
        self._changes += 1
        self._state *= scale
        self._state[:3] += shift
        self.coefficients *= scale
        self.coefficients[0] += shift


def _response(step: float, forward: float) -> tuple[float, float, float]:
    """Weights of c₀, y₀ and c₁ in y₁; ``step`` is dt/τ, ``forward`` the feed-forward f.

    Over a tick c = c₀ + m·t, and the lag's solution is y = c + (f−1)·τ·m + K·exp(−t/τ) with K
    from y(0) = y₀; m = (c₁ − c₀)/dt sorts the terms.
    """
    decay = math.exp(-step)
    slope = (1 - decay) * (forward - 1) / step
    return -slope - decay, decay, 1 + slope


def _basis(time_s: float) -> FloatArray:
    """Position, velocity and acceleration of p, v, h, j after ``time_s``."""
    t = time_s
    return np.array([[1, t, t**2, t**3], [0, 1, 2 * t, 3 * t**2], [0, 0, 2, 6 * t]])


def _shift(time_s: float) -> FloatArray:
    """Coefficients about an origin that is ``time_s`` later."""
    t = time_s
    return np.array([[1, t, t**2, t**3], [0, 1, 2 * t, 3 * t**2], [0, 0, 1, 3 * t], [0, 0, 0, 1]])
