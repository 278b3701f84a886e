"""State flags of each axis, besides its motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robotd.api import CommandMode, Operation

Flags = NDArray[np.bool_]
Numbers = NDArray[np.int64]


class AxisStates:
    """Flags and numbers of shape (n_axes,), changed in place under the world's lock.

    At first all axes are connected, off and idle.

    Attributes:
        connected: the drive's slave answers; with communication up, the axis is online.
        mode: what commands mean; ``mode_feedback`` is what the drive really does and lags.
        servo_wanted: the last request, so that a delayed enable can be overtaken.
        following_alarm: a following error stopped the axis.
        reason: why an axis is in alarm or offline, or what stopped it; "" for nothing. Not an
            array: one text per axis.
    """

    def __init__(self, axes: int) -> None:
        self._flags: Flags = np.zeros((7, axes), bool)
        self._numbers: Numbers = np.zeros((4, axes), np.int64)
        self.servo_on, self.servo_wanted, self.amp_alarm, self.connected = self._flags[:4]
        self.home_done, self.motion_complete, self.following_alarm = self._flags[4:]
        self.alarm_code, self.mode, self.mode_feedback, self.operation = self._numbers
        self.reason = [""] * axes
        self.connected[:] = True
        self.mode[:] = self.mode_feedback[:] = CommandMode.POSITION
        self.operation[:] = Operation.IDLE

    def snapshot(self) -> tuple[bytes, bytes, tuple[str, ...]]:
        """Equals another one if nothing has changed since."""
        return self._flags.tobytes(), self._numbers.tobytes(), tuple(self.reason)
