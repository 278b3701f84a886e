"""The engine's I/O images."""

from __future__ import annotations

from robotd.plugin.api import IoDriver
from robotd_wmx import _native
from robotd_wmx.connection import Connection
from robotd_wmx.errors import translated


class WmxIo(IoDriver):
    """Reads answer from the image of the last cycle; writes reach the slaves with the next."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    @property
    def input_bytes(self) -> int:
        return _native.INPUT_BYTES

    @property
    def output_bytes(self) -> int:
        return _native.OUTPUT_BYTES

    def read_inputs(self, byte: int, length: int) -> bytes:
        with translated(f"input byte {byte}"):
            return self._connection.status.read_inputs(byte, length)

    def read_outputs(self, byte: int, length: int) -> bytes:
        with translated(f"output byte {byte}"):
            return self._connection.status.read_outputs(byte, length)

    def write_outputs(self, byte: int, data: bytes) -> None:
        with translated(f"output byte {byte}"):
            self._connection.command.write_outputs(byte, data)

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        """The engine changes the bit alone."""
        with translated(f"output byte {byte} bit {bit}"):
            self._connection.command.write_output_bit(byte, bit, value)
