"""The engine's I/O images."""

from __future__ import annotations

from collections.abc import Callable

from robotd.api import IoDriver, NotReady
from robotd_wmx import _native
from robotd_wmx._native import Device
from robotd_wmx.connection import Connection
from robotd_wmx.errors import translated


class WmxIo(IoDriver):
    """Digital I/O: reads use the last cycle's image, writes the next one.

    Without an engine a read answers what was read last, 0 before that.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._inputs = bytearray(_native.INPUT_BYTES)
        self._outputs = bytearray(_native.OUTPUT_BYTES)

    @property
    def input_bytes(self) -> int:
        return _native.INPUT_BYTES

    @property
    def output_bytes(self) -> int:
        return _native.OUTPUT_BYTES

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
