"""State flags of each axis, besides its motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robotd.api import CommandMode, FloatArray, InvalidArgument, Operation
from robotd_sim.options import SimOptions

Flags = NDArray[np.bool_]
Numbers = NDArray[np.int64]


class AxisStates:
    """Flags and numbers of shape (n_axes,), changed in place under the world's lock.

    At first all axes are connected, off and idle.

    Attributes:
        connected: the drive's slave answers; with communication up, the axis is online.
        mode: what commands mean; ``mode_feedback`` is what the drive really does and lags.
        servo_wanted: the last request, so that a delayed enable can be overtaken.
        reason: why an axis is in alarm or offline, or what stopped it; "" for nothing. Not an
            array: one text per axis.
    """

    def __init__(self, axes: int) -> None:
        self._flags: Flags = np.zeros((6, axes), bool)
        self._numbers: Numbers = np.zeros((4, axes), np.int64)
        self.servo_on, self.servo_wanted, self.amp_alarm, self.connected = self._flags[:4]
        self.home_done, self.motion_complete = self._flags[4:]
        self.alarm_code, self.mode, self.mode_feedback, self.operation = self._numbers
        self.reason = [""] * axes
        self.connected[:] = True
        self.mode[:] = self.mode_feedback[:] = CommandMode.POSITION
        self.operation[:] = Operation.IDLE

    def snapshot(self) -> tuple[bytes, bytes, tuple[str, ...]]:
        """Equals another one if nothing has changed since."""
        return self._flags.tobytes(), self._numbers.tobytes(), tuple(self.reason)


class AxisSwitches:
    """Three switches per axis, by the names of the process image. Hold the world's lock.

    Attributes:
        low, high: (n_axes,) ends of the range in which a switch is closed, by its name.
        changes: number of calls of ``press``.
    """

    def __init__(self, axes: int, options: SimOptions) -> None:
        names = ("negative_limit", "positive_limit", "home_switch")
        self.low = {name: np.full(axes, np.inf) for name in names}
        self.high = {name: np.full(axes, -np.inf) for name in names}
        self.low["negative_limit"][:] = -np.inf
        self.high["positive_limit"][:] = np.inf
        for axis, ends in options.limit_switches.items():
            if ends.negative_rad is not None:
                self.high["negative_limit"][axis] = ends.negative_rad
            if ends.positive_rad is not None:
                self.low["positive_limit"][axis] = ends.positive_rad
        for axis, home in options.home_switches.items():
            self.low["home_switch"][axis] = home.position_rad - home.width_rad / 2
            self.high["home_switch"][axis] = home.position_rad + home.width_rad / 2
        self.in_use = bool(options.limit_switches or options.home_switches)
        self.changes = 0
        self._places = {name: (self.low[name].copy(), self.high[name].copy()) for name in names}

    def press(self, axis: int, switch: str, *, pressed: bool) -> None:
        """Close a switch wherever the axis is, or let it act at its place again.

        Raises InvalidArgument: there is no such switch.
        """
        if switch not in self._places:
            raise InvalidArgument(f"no switch {switch!r}, there are {', '.join(self._places)}")
        low, high = self._places[switch]
        self.low[switch][axis] = -np.inf if pressed else low[axis]
        self.high[switch][axis] = np.inf if pressed else high[axis]
        self.in_use = True
        self.changes += 1

    def read(self, switch: str, position: FloatArray, closed: Flags) -> None:
        """Fill ``closed`` (n_axes,) with the levels of ``switch`` at ``position``."""
        np.greater_equal(position, self.low[switch], closed)
        closed &= position <= self.high[switch]
