"""The process image: what the fieldbus said last, and what was commanded, per axis."""

from __future__ import annotations

import numpy as np

from robotd.arrays import BoolArray, FloatArray, IntArray
from robotd.device.state import CommandMode, Operation

COPY_TRIES = 2000  # tens of milliseconds; a read takes a tenth of one


class ProcessImage:
    """Preallocated arrays of shape (n_axes,), overwritten in place once a cycle.

    The cycle thread is the only writer: ``AxisDriver.read`` assigns into the arrays
    (``image.position[:] = ...``) and never replaces them. Other threads take ``copy()``.
    Values are NaN until they are known, and NaN where a device cannot know them.

    Attributes:
        position, velocity, torque: measured; rad or m, rad/s or m/s, N·m or N.
        position_command, velocity_command: what the servo is asked for now, same units.
        servo_on, amp_alarm, offline: the drive is enabled, in alarm, not answering.
        alarm_code: the drive's own alarm number, 0 without an alarm.
        home_done, home_switch, negative_limit, positive_limit: as the drive reports them.
        motion_complete: the last move or trajectory ran to its end and the axis is idle.
        mode, operation: ``CommandMode`` and ``Operation`` as integers.
        reason: the device's own words for an alarm or for a drive that does not answer; "" where
            it has none.
        stamp_ns: monotonic time of the last ``read``; 0 before the first.
        fresh_ns: monotonic time at which the device last received live values; 0 if never.
    """

    def __init__(self, axes: int) -> None:
        self.axes = axes
        self.stamp_ns = 0
        self.fresh_ns = 0
        self.position: FloatArray = np.full(axes, np.nan)
        self.velocity: FloatArray = np.full(axes, np.nan)
        self.torque: FloatArray = np.full(axes, np.nan)
        self.position_command: FloatArray = np.full(axes, np.nan)
        self.velocity_command: FloatArray = np.full(axes, np.nan)
        self.servo_on: BoolArray = np.zeros(axes, bool)
        self.amp_alarm: BoolArray = np.zeros(axes, bool)
        self.offline: BoolArray = np.ones(axes, bool)
        self.home_done: BoolArray = np.zeros(axes, bool)
        self.home_switch: BoolArray = np.zeros(axes, bool)
        self.negative_limit: BoolArray = np.zeros(axes, bool)
        self.positive_limit: BoolArray = np.zeros(axes, bool)
        self.motion_complete: BoolArray = np.zeros(axes, bool)
        self.alarm_code: IntArray = np.zeros(axes, np.int64)
        self.mode: IntArray = np.full(axes, CommandMode.POSITION, np.int64)
        self.operation: IntArray = np.full(axes, Operation.IDLE, np.int64)
        self.reason = [""] * axes
        self._sequence = 0

    def fault(self, axis: int) -> str:
        """Why ``axis`` cannot move: not answering, in alarm, or ""; with the device's reason."""
        if self.offline[axis]:
            what = "drive is offline"
        elif self.amp_alarm[axis]:
            what = f"amplifier alarm {self.alarm_code[axis]}"
        else:
            return ""
        reason = self.reason[axis]
        return f"{what} ({reason})" if reason else what

    def begin_write(self) -> None:
        """Cycle thread: the arrays are about to change."""
        self._sequence += 1

    def end_write(self) -> None:
        """Cycle thread: the arrays are consistent again."""
        self._sequence += 1

    def forget(self) -> None:
        """Cycle thread: nothing is known any more, as before the first ``read``."""
        self.begin_write()
        blank = ProcessImage(self.axes)
        for name in _ARRAYS:
            getattr(self, name)[:] = getattr(blank, name)
        self.reason[:] = blank.reason
        self.stamp_ns = self.fresh_ns = 0
        self.end_write()

    def copy(self) -> ProcessImage:
        """A consistent copy. Any thread may call; retries while the cycle writes.

        Of a write that does not end, because the driver hangs, it is a copy of what there is.
        """
        twin = ProcessImage(self.axes)
        for _ in range(COPY_TRIES):
            before = self._sequence
            for name in _ARRAYS:
                getattr(twin, name)[:] = getattr(self, name)
            twin.reason[:] = self.reason
            twin.stamp_ns, twin.fresh_ns = self.stamp_ns, self.fresh_ns
            if before == self._sequence and before % 2 == 0:
                break
        return twin


_ARRAYS = tuple(
    name for name, value in vars(ProcessImage(0)).items() if isinstance(value, np.ndarray)
)
