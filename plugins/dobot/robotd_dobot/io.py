"""Digital inputs and outputs of the controller: 16 each, terminal 1 is bit 0 of byte 0."""

from __future__ import annotations

from robotd.api import IoDriver
from robotd_dobot.device import DobotDevice

BYTES = 2


class DobotIo(IoDriver):
    """Reads answer from the newest feedback; each output bit is a command of its own."""

    def __init__(self, device: DobotDevice) -> None:
        self._device = device

    @property
    def input_bytes(self) -> int:
        return BYTES

    @property
    def output_bytes(self) -> int:
        return BYTES

    def read_inputs(self, byte: int, length: int) -> bytes:
        values = self._device.feedback
        return values.inputs[byte : byte + length] if values else bytes(length)

    def read_outputs(self, byte: int, length: int) -> bytes:
        values = self._device.feedback
        return values.outputs[byte : byte + length] if values else bytes(length)

    def write_outputs(self, byte: int, data: bytes) -> None:
        for index, value in enumerate(data, byte):
            for bit in range(8):
                self.write_output_bit(index, bit, bool(value >> bit & 1))

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        link = self._device.link
        link.command(link.dialect.set_output, 8 * byte + bit + 1, value)
