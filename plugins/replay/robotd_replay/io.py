"""Inputs and outputs of a recording; outputs cannot be written."""

from __future__ import annotations

from robotd.api import IoDriver, Unsupported
from robotd_replay.device import IMAGE_BYTES, ReplayDevice


class ReplayIo(IoDriver):
    """The I/O image as it was; zeros where nothing was recorded."""

    def __init__(self, device: ReplayDevice) -> None:
        self._device = device

    @property
    def input_bytes(self) -> int:
        return IMAGE_BYTES

    @property
    def output_bytes(self) -> int:
        return IMAGE_BYTES

    @property
    def live(self) -> tuple[memoryview, memoryview]:
        return memoryview(self._device.inputs), memoryview(self._device.outputs)

    def read_inputs(self, byte: int, length: int) -> bytes:
        return bytes(self._device.inputs[byte : byte + length])

    def read_outputs(self, byte: int, length: int) -> bytes:
        return bytes(self._device.outputs[byte : byte + length])

    def write_outputs(self, byte: int, data: bytes) -> None:
        raise Unsupported("outputs of a recording")

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        raise Unsupported("outputs of a recording")
