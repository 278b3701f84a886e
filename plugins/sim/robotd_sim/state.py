"""What is known of each axis besides its motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from robotd.plugin.api import CommandMode, Operation

Flags = NDArray[np.bool_]
Numbers = NDArray[np.int64]


@dataclass(frozen=True)
class AxisStates:
    """Flags and numbers of shape (n_axes,), changed in place under the world's lock.

    Attributes:
        connected: the drive's slave answers; with communication up, the axis is online.
        mode: what commands mean; ``mode_feedback`` is what the drive really does and lags.
        servo_wanted: the last request, so that a delayed enable can be overtaken.
        following_alarm: a following error stopped the axis.
        reason: why an axis is in alarm or offline, or what stopped it; "" for nothing. Not an
            array: one text per axis.
    """

    servo_on: Flags
    servo_wanted: Flags
    amp_alarm: Flags
    connected: Flags
    home_done: Flags
    motion_complete: Flags
    following_alarm: Flags
    alarm_code: Numbers
    mode: Numbers
    mode_feedback: Numbers
    operation: Numbers
    reason: list[str]

    @classmethod
    def of(cls, axes: int) -> Self:
        """All axes connected, off and idle."""

        def flags() -> Flags:
            return np.zeros(axes, bool)

        def numbers(value: int) -> Numbers:
            return np.full(axes, value, np.int64)

        return cls(
            servo_on=flags(),
            servo_wanted=flags(),
            amp_alarm=flags(),
            connected=~flags(),
            home_done=flags(),
            motion_complete=flags(),
            following_alarm=flags(),
            alarm_code=numbers(0),
            mode=numbers(CommandMode.POSITION),
            mode_feedback=numbers(CommandMode.POSITION),
            operation=numbers(Operation.IDLE),
            reason=[""] * axes,
        )
