"""Process image: measured values, commands and states of all axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotd.arrays import BoolArray, FloatArray, IntArray
from robotd.device.state import CommandMode, Operation

HEADER_NUMBERS = 9  # of the frame of a recorder
COPY_TRIES = 2000  # tens of milliseconds; a read takes a tenth of one


# Rows of ``ProcessImage.values`` and ``ProcessImage.flags``.
VALUES = ("position_command", "velocity_command", "position", "velocity", "torque")
FLAGS = (
    "amp_alarm", "servo_on", "home_done", "home_switch", "negative_limit", "positive_limit",
    "motion_complete", "offline",
)  # fmt: skip
NUMBERS = ("alarm_code", "mode", "operation")


def image_type(axes: int) -> np.dtype[np.void]:
    """Return the layout of the arrays in memory: blocks of shape (rows, axes)."""
    return np.dtype(
        [
            ("values", "<f8", (len(VALUES), axes)),
            ("setpoint", "<f8", (2, axes)),
            ("numbers", "<i8", (len(NUMBERS), axes)),
            ("flags", "?", (len(FLAGS), axes)),
            ("padding", "V1", (-len(FLAGS) * axes % 8,)),
        ]
    )


class ProcessImage:
    """Preallocated arrays of shape (n_axes,), overwritten in place once a cycle.

    The control-loop thread is the only writer: ``AxisDriver.read`` assigns into the arrays
    (``image.position[:] = ...``) and never replaces them. Other threads take ``copy()``.
    Values are NaN until they are known, and NaN where a device cannot know them.

    Attributes:
        position, velocity, torque: measured; rad or m, rad/s or m/s, N·m or N.
        position_command, velocity_command: what the servo is asked for now, same units; of an
            axis at rest a velocity of 0.
        servo_on, amp_alarm, offline: the drive is enabled, in alarm, not answering.
        alarm_code: the drive's own alarm number, 0 without an alarm.
        home_done, home_switch, negative_limit, positive_limit: as the drive reports them.
        motion_complete: the last move or trajectory ran to its end and the axis is idle; False
            while anything is executed.
        mode, operation: ``CommandMode`` that the drive is in, and ``Operation``, as integers.
        setpoint: (2, n_axes) position and velocity of the last setpoints that were sent.
        values, flags, numbers: the arrays above are the rows of these three blocks, whose order
            is that of ``VALUES``, ``FLAGS`` and ``NUMBERS``. A copy of a block costs no more than
            one of an array.
        memory: all blocks in one piece, laid out by ``image_type``: one copy takes them all.
        states: flags and numbers of all axes as bytes, to find with one comparison that no
            state has changed.
        header, frame: room for a recorder's numbers, and with ``memory`` after it in one piece.
        commands, measured: rows of ``values``: position and velocity as commanded; position,
            velocity and torque as measured.
        silent: (n_axes,) the drive has not acknowledged its latest cyclic frames and is not lost
            yet: the axis gets no setpoint, and will continue from ``position_command``. Written by
            drivers that know what each drive has acknowledged; False elsewhere.
        reason: the device's own words for an alarm, for a drive that does not answer, or for a
            stop that was not commanded, until the next command; "" where it has none.
        controller_alarm, controller_reason: alarm number and text of the whole controller, see
            ``set_controller_alarm``; 0 and "" without one.
        stamp_ns: monotonic time of the last ``read``; 0 before the first.
        fresh_ns: monotonic time of the last live values, see ``AxisDriver.read``; 0 before any.
        shift_ns: by how much the next period begins later, or earlier where it is negative; written
            by a driver whose device has a clock that the control loop is to follow. 1 % of the
            period at most is applied, once.
    """

    position_command: FloatArray
    velocity_command: FloatArray
    position: FloatArray
    velocity: FloatArray
    torque: FloatArray
    amp_alarm: BoolArray
    servo_on: BoolArray
    home_done: BoolArray
    home_switch: BoolArray
    negative_limit: BoolArray
    positive_limit: BoolArray
    motion_complete: BoolArray
    offline: BoolArray
    alarm_code: IntArray
    mode: IntArray
    operation: IntArray

    def __init__(self, axes: int) -> None:
        self.axes = axes
        self.stamp_ns = 0
        self.fresh_ns = 0
        self.shift_ns = 0
        room = np.zeros(1, [("header", "<i8", HEADER_NUMBERS), ("blocks", image_type(axes))])
        self.frame = room.view(np.uint8).data
        self.header = self.frame[: 8 * HEADER_NUMBERS].cast("q")
        self.memory = self.frame[8 * HEADER_NUMBERS :]
        blocks = room["blocks"]
        self.states = self.memory[(len(VALUES) + 2) * 8 * axes :]  # after values and setpoint
        self.values: FloatArray = blocks["values"][0]
        self.setpoint: FloatArray = blocks["setpoint"][0]
        self.numbers: IntArray = blocks["numbers"][0]
        self.flags: BoolArray = blocks["flags"][0]
        self.values[:] = self.setpoint[:] = np.nan
        self.commands, self.measured = self.values[:2], self.values[2:]
        for names, block in ((VALUES, self.values), (FLAGS, self.flags), (NUMBERS, self.numbers)):
            for name, row in zip(names, block, strict=True):
                setattr(self, name, row)
        self.silent: BoolArray = np.zeros(axes, bool)
        self.offline[:] = True
        self.mode[:] = CommandMode.POSITION
        self.operation[:] = Operation.IDLE
        self.reason = [""] * axes
        self.controller_alarm = 0
        self.controller_reason = ""
        self._sequence = 0

    def fault(self, axis: int) -> str:
        """Fault of ``axis`` with the device's reason: offline or in alarm, else ""."""
        if self.offline[axis]:
            what = "drive is offline"
        elif self.controller_alarm:
            return f"controller alarm {self.controller_alarm}"
        elif self.amp_alarm[axis]:
            what = f"amplifier alarm {self.alarm_code[axis]}"
        else:
            return ""
        reason = self.reason[axis]
        return f"{what} ({reason})" if reason else what

    @property
    def controller_fault(self) -> str:
        """``controller alarm 17 (emergency stop)``; "" without an alarm."""
        if not self.controller_alarm:
            return ""
        reason = f" ({self.controller_reason})" if self.controller_reason else ""
        return f"controller alarm {self.controller_alarm}{reason}"

    def set_controller_alarm(self, code: int, reason: str = "") -> None:
        """Show one alarm of the whole controller, on every axis (CONTROLLER_ALARM).

        Control-loop thread, in ``AxisDriver.read``.

        Args:
            code: the controller's alarm number; 0: no alarm.
            reason: one line in words.
        """
        self.controller_alarm, self.controller_reason = code, reason if code else ""
        self.amp_alarm[:] = code != 0
        self.alarm_code[:] = code

    def begin_write(self) -> None:
        """Begin to change the arrays. Control-loop thread."""
        self._sequence += 1

    def end_write(self) -> None:
        """End the change: the arrays are consistent. Control-loop thread."""
        self._sequence += 1

    def forget(self) -> None:
        """Clear all values, as before the first ``read``. Control-loop thread."""
        self.begin_write()
        blank = ProcessImage(self.axes)
        self.memory[:] = blank.memory
        self.silent[:] = False
        self.reason[:] = blank.reason
        self.controller_alarm, self.controller_reason = 0, ""
        self.stamp_ns = self.fresh_ns = 0
        self.end_write()

    def copy(self) -> ProcessImage:
        """Return a consistent copy. Any thread; retries while the control loop writes.

        Of a write that does not end, because the driver hangs, it is a copy of what there is.
        """
        twin = ProcessImage(self.axes)
        for _ in range(COPY_TRIES):
            before = self._sequence
            twin.memory[:] = self.memory
            twin.silent[:] = self.silent
            twin.reason[:] = self.reason
            twin.stamp_ns, twin.fresh_ns = self.stamp_ns, self.fresh_ns
            twin.controller_alarm = self.controller_alarm
            twin.controller_reason = self.controller_reason
            if before == self._sequence and before % 2 == 0:
                break
        return twin


def columns(axes: Sequence[int] | IntArray) -> slice | IntArray:
    """Return the index of ``axes``: a slice where one does, which NumPy copies faster."""
    index = np.asarray(axes, np.int64)
    if len(index) and (np.diff(index) == 1).all():
        return slice(int(index[0]), int(index[-1]) + 1)
    return index
