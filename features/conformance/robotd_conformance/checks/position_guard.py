"""Guard of all commands of the checks: nothing is commanded out of the room of an axis.

The room is what the position limits and ``--range`` leave, less a margin. A command that leads
out of it never reaches the driver; the axes stop, and the check that gave it is refused: it has
neither passed nor failed, whatever it makes of the error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from robotd.api import (
    AxisDriver,
    CommandMode,
    DeviceDriver,
    FloatArray,
    Operation,
    OperationError,
    ProcessImage,
    Profile,
)
from robotd_conformance.checks.start_pose import StartPose

SAME = 1e-3  # rad or m: positions that differ by less are the same
ROUNDING = 1e-6
BY_VELOCITY = (Operation.VELOCITY, Operation.STREAM)
POSITION_MODE = int(CommandMode.POSITION)  # NumPy compares with an int faster


class Refused(OperationError):
    """A command of a check that leads out of the room of an axis."""


class PositionGuard:
    """Room of the axes of one harness, and the methods of its drivers that it guards.

    Positions change their meaning with home, scale and parameters; the guard converts them to those
    of the start of the run. Commands: any thread; ``track``: control loop.

    Args:
        pose: start pose of the run, and its room; nothing is guarded before it is known.
        image: of the robot, as shown.
        max_accelerations: (n_axes,) at which an axis can stop at most.
        period_s: until a command has an effect.
        stop: stops all axes, with the reason; it must not wait.

    Attributes:
        refused: reason of the first command that was refused; "" without one.
    """

    def __init__(
        self,
        pose: StartPose,
        image: ProcessImage,
        max_accelerations: FloatArray,
        period_s: float,
        stop: Callable[[str], None],
    ) -> None:
        self._pose, self._image, self._period_s, self._stop = pose, image, period_s, stop
        self._reach = 0.5 / np.maximum(max_accelerations, 1e-9)  # stopping distance, per speed²
        self._ramps = self._reach.copy()  # the same of the present commands
        count = len(image.position)
        self._streaming = np.zeros(count, bool)
        self._scale, self._offset = np.ones(count), np.zeros(count)
        self._before: list[float | None] = [None] * count  # position before a change of scale
        self._bounds: FloatArray | None = None  # (2, n_axes) of the room, in present positions
        self.refused = ""

    def methods(self, driver: DeviceDriver | AxisDriver) -> dict[str, Callable[..., Any]]:
        """Return those methods of ``driver`` that are guarded, by their names."""
        own: dict[str, Callable[..., None]] = {
            "move": self._move, "jog": self._jog, "begin_stream": self._begin_stream,
            "end_stream": self._end_stream, "stream": self._stream, "follow": self._follow,
            "home": partial(self._home, driver), "search_home": self._search_home,
            "set_polarity": self._rescale, "set_gear_ratio": self._rescale,
            "load_parameters": self._reload, "open": self._open,
        }  # fmt: skip
        return {
            name: _preceded(before, getattr(driver, name))
            for name, before in own.items()
            if hasattr(driver, name)
        }

    # Commands: the arguments are those of the driver's methods.

    def _move(self, axis: int, target: float, profile: Profile) -> None:
        self._check(axis, target, "a move to")
        self._check_turn(axis, profile.deceleration)
        self._ramps[axis] = 0.5 / profile.deceleration

    def _jog(self, axis: int, profile: Profile) -> None:
        self._check_turn(axis, profile.deceleration)
        here, speed = float(self._image.position_command[axis]), profile.velocity
        braking = speed * abs(speed) / (2.0 * profile.deceleration)
        self._ramps[axis] = 0.5 / profile.deceleration
        if np.isfinite(here):
            self._check(
                axis, here + braking, f"a velocity of {speed:.3g} {self._unit(axis)}/s until"
            )

    def _begin_stream(self, axes: Sequence[int]) -> None:
        self._streaming[list(axes)] = True
        self._ramps[list(axes)] = self._reach[list(axes)]

    def _end_stream(self, axes: Sequence[int]) -> None:
        self._streaming[list(axes)] = False

    def _stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        if self._pose.position is None:
            return
        streaming, image = self._streaming, self._image
        by_position = streaming & (image.mode == POSITION_MODE)
        ends = np.where(by_position, position, image.position_command)
        ends += np.where(streaming, velocity * np.abs(velocity) * self._reach, 0.0)
        for axis in self._outside(ends):
            if streaming[axis]:
                self._check(axis, float(ends[axis]), "a setpoint that leads to")

    def _follow(self, axes: Sequence[int], times_s: FloatArray, positions: FloatArray) -> None:
        for column, axis in enumerate(axes):
            for extreme in (positions[:, column].min(), positions[:, column].max()):
                self._check(axis, float(extreme), "a trajectory to")

    def _check_turn(self, axis: int, deceleration: float) -> None:
        """Check where an axis in motion comes to rest before it turns."""
        speed = float(self._image.velocity_command[axis])
        braking = speed * abs(speed) / (2.0 * deceleration)
        end = float(self._image.position_command[axis]) + braking
        if speed and np.isfinite(end):
            self._check(axis, end, "a command in motion, which leads to")

    def track(self, image: ProcessImage) -> None:
        """Stop axes that would leave their room by a velocity, which has no target."""
        if self._pose.position is None or self.refused or not image.operation.any():
            return
        speed = image.velocity_command
        ends = image.position_command + speed * (np.abs(speed) * self._ramps + self._period_s)
        for axis in self._outside(ends):
            if image.operation.item(axis) in BY_VELOCITY and speed[axis]:
                self._refuse(axis, float(ends[axis]), "a motion that leads to")

    # Positions that change their meaning

    def _home(self, driver: Any, axis: int, timeout_s: float) -> None:
        """The present position is zero from now on; the home of one that moves is not known."""
        if driver.homing_speed(axis) > 0.0:
            self._search_home(axis)
        here = self._true(axis, float(self._image.position[axis]))
        if np.isfinite(here):
            self._offset[axis] = here
            self._bounds = None

    def _search_home(self, axis: int, *_: object) -> None:
        raise Refused(self._refuse(axis, math.nan, "a homing that moves to"))

    def _rescale(self, axis: int, *_: object) -> None:
        """The axis stays where it is, and its position may have another number."""
        self._settle(axis)
        self._before[axis] = float(self._image.position[axis])

    def _reload(self, *_: object, **__: object) -> None:
        for axis in range(len(self._scale)):
            self._rescale(axis)

    def _open(self, *_: object, **__: object) -> None:
        """Scale and home are those of the parameter file again, at the next command."""
        self._streaming[:] = False
        self._scale[:], self._offset[:] = 1.0, 0.0
        self._before = [None] * len(self._scale)
        self._bounds = None

    def _settle(self, axis: int) -> None:
        """Take over the scale that shows in the present position."""
        before, shown = self._before[axis], float(self._image.position[axis])
        if before is None or not np.isfinite(shown):
            return
        self._before[axis] = None
        if np.isfinite(before) and min(abs(shown), abs(before), abs(shown - before)) > SAME:
            self._scale[axis] *= before / shown
            self._bounds = None

    def _true(self, axis: int, shown: float) -> float:
        """Convert to a position as it was at the start of the run."""
        self._settle(axis)
        return float(self._scale[axis] * shown + self._offset[axis])

    # The room

    def _outside(self, ends: FloatArray) -> list[int]:
        """Return the axes that are out of their room at ``ends`` (n_axes,)."""
        if self._bounds is None:
            lower, upper = np.sort((self._pose.room - self._offset) / self._scale, axis=0)
            self._bounds = np.array([lower - ROUNDING, upper + ROUNDING])
        outside = (ends < self._bounds[0]) | (ends > self._bounds[1])
        return np.flatnonzero(outside).tolist() if outside.any() else []

    def _check(self, axis: int, end: float, what: str) -> None:
        """Raise Refused where ``end`` is out of the room, and farther than the axis is."""
        if self._pose.position is None:
            return
        true, here = self._true(axis, end), self._true(axis, self._image.position_command[axis])
        lower, upper = self._pose.room[:, axis]
        if np.isfinite(here):
            lower, upper = min(lower, here), max(upper, here)
        if not lower - ROUNDING <= true <= upper + ROUNDING:
            raise Refused(self._refuse(axis, end, what))

    def _refuse(self, axis: int, end: float, what: str) -> str:
        reason = self._pose.refusal(axis, f"{what} {end:.4g} {self._unit(axis)}")
        if not self.refused:
            self.refused = reason
            self._stop(reason)
        return reason

    def _unit(self, axis: int) -> str:
        return self._pose.units[axis]


def _preceded(before: Callable[..., None], call: Callable[..., Any]) -> Callable[..., Any]:
    """Return ``call``, made after ``before`` with the same arguments."""

    def guarded(*given: Any, **named: Any) -> Any:
        before(*given, **named)
        return call(*given, **named)

    return guarded
