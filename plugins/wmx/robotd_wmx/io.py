"""The engine's I/O images, of which the first bytes are copied in every period."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from robotd.api import IoDriver, NotReady
from robotd_wmx import _native
from robotd_wmx._native import CallError, Device
from robotd_wmx.connection import WmxConnection
from robotd_wmx.errors import translated

LIVE_BYTES = 256  # of each image


class IoCopy:
    """First bytes of both images, updated in place by the control loop.

    Attributes:
        inputs, outputs: ``LIVE_BYTES`` each, 0 before the first update.
    """

    def __init__(self) -> None:
        self.inputs, self.outputs = bytearray(LIVE_BYTES), bytearray(LIVE_BYTES)

    def update(self, device: Device) -> None:
        """Copy both images; they stay as they were where the engine has none."""
        with suppress(CallError):
            self.inputs[:] = device.read_inputs(0, LIVE_BYTES)
            self.outputs[:] = device.read_outputs(0, LIVE_BYTES)


class WmxIo(IoDriver):
    """Digital I/O: reads use the last cycle's image, writes the next one.

    Without an engine a read answers what was read last, 0 before that.
    """

    def __init__(self, connection: WmxConnection) -> None:
        self._connection = connection
        self._copy = IoCopy()
        connection.after_read(self._copy.update)
        self._inputs = bytearray(_native.INPUT_BYTES)
        self._outputs = bytearray(_native.OUTPUT_BYTES)

    @property
    def input_bytes(self) -> int:
        return _native.INPUT_BYTES

    @property
    def output_bytes(self) -> int:
        return _native.OUTPUT_BYTES

    @property
    def live(self) -> tuple[memoryview, memoryview]:
        return memoryview(self._copy.inputs), memoryview(self._copy.outputs)

    def read_inputs(self, byte: int, length: int) -> bytes:
        return self._read(Device.read_inputs, self._inputs, "input", byte, length)

    def read_outputs(self, byte: int, length: int) -> bytes:
        return self._read(Device.read_outputs, self._outputs, "output", byte, length)

    def write_outputs(self, byte: int, data: bytes) -> None:
        with translated(f"output byte {byte}"):
            self._connection.command.write_outputs(byte, data)

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        """The engine changes the bit alone."""
        with translated(f"output byte {byte} bit {bit}"):
            self._connection.command.write_output_bit(byte, bit, value)

    def _read(
        self,
        call: Callable[[Device, int, int], bytes],
        last: bytearray,
        name: str,
        byte: int,
        length: int,
    ) -> bytes:
        where = slice(byte, byte + length)
        try:
            with translated(f"{name} byte {byte}"):
                last[where] = call(self._connection.status, byte, length)
        except NotReady:
            pass  # no engine, or no longer: see the state
        return bytes(last[where])
