"""The process image, filled by one call of the engine."""

from __future__ import annotations

import numpy as np

from robotd.api import Operation, ProcessImage
from robotd_wmx._native import StatusReader
from robotd_wmx.connection import WmxConnection
from robotd_wmx.engine_time import EngineTime
from robotd_wmx.position_stream import PositionStream
from robotd_wmx.velocity_stream import VelocityStream

# NumPy compares an array with an int in 1 µs, with a member of an enum in 8 (Python 3.11).
IDLE, VELOCITY, STREAM = int(Operation.IDLE), int(Operation.VELOCITY), int(Operation.STREAM)


class Readout:
    """Fills the process image in place by one call of the binding."""

    def __init__(
        self, connection: WmxConnection, stream: VelocityStream, positions: PositionStream
    ) -> None:
        self._connection = connection
        self._stream = stream
        self._positions = positions
        self._bound: tuple[object, ProcessImage] | None = None
        self._reader: StatusReader | None = None
        self._time = EngineTime()
        self._cycle = -1
        self._alarms = False  # whether the image has a reason for one

    def fill(self, image: ProcessImage) -> None:
        """Raises NotReady or CallError when the engine is gone."""
        device = self._connection.status
        if self._reader is None or self._bound != (device, image):
            self._reader, self._bound = self._bind(image), (device, image)
        reader = self._reader
        cycle, now_ns = reader.read(), self._connection.clock.now_ns()
        cycle_ns = int(reader.cycle_ms * 1e6)
        if reader.communicating and cycle != self._cycle:
            image.fresh_ns = self._time.of(cycle, cycle_ns, now_ns)
        # A control loop as fast as the engine may find a cycle twice.
        halted = cycle == self._cycle and now_ns - image.fresh_ns > 2 * cycle_ns
        self._cycle = cycle
        if self._alarms or image.amp_alarm.any():
            self._explain(image)
        image.silent[:] = False
        if self._stream.active.any() or self._stream.rolling.any():
            # A halted engine would ramp in one period to all that is sent meanwhile.
            image.silent |= self._stream.active if halted else self._stream.behind
            self._stream.drop(~image.servo_on | image.amp_alarm | image.offline)
            self._mark_streaming(image)
        if self._positions.running:
            self._mark_positions(image)
        self._connection.was_read(device)

    def _explain(self, image: ProcessImage) -> None:
        """Manuals of drives list alarms by their hexadecimal numbers; the engine has no texts."""
        self._alarms = bool(image.amp_alarm.any())
        for axis, alarm in enumerate(image.amp_alarm):
            image.reason[axis] = f"code 0x{image.alarm_code[axis]:04X}" if alarm else ""

    def _mark_streaming(self, image: ProcessImage) -> None:
        """The engine knows streamed axes as idle or as executing a velocity command."""
        streaming = self._stream.active & image.servo_on
        streaming &= (image.operation == IDLE) | (image.operation == VELOCITY)
        image.operation[streaming] = Operation.STREAM

    def _mark_positions(self, image: ProcessImage) -> None:
        """Show a stop by ramp commands as stopping: the engine reports direct control."""
        for axis in np.flatnonzero(image.operation == STREAM).tolist():
            if self._positions.stopping(axis):
                image.operation[axis] = Operation.STOPPING
        if reason := self._positions.fault:
            self._alarms = True
            for axis in np.flatnonzero(image.operation != STREAM).tolist():
                image.reason[axis] = image.reason[axis] or reason

    def _bind(self, image: ProcessImage) -> StatusReader:
        scaling = self._connection.scaling
        return StatusReader(
            self._connection.status,
            scaling.si,
            scaling.torque,
            image.position,
            image.velocity,
            image.torque,
            image.position_command,
            image.velocity_command,
            image.servo_on,
            image.amp_alarm,
            image.offline,
            image.home_done,
            image.home_switch,
            image.negative_limit,
            image.positive_limit,
            image.motion_complete,
            image.alarm_code,
            image.mode,
            image.operation,
        )
