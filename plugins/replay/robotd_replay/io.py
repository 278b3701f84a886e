"""Inputs and outputs of a recording; outputs cannot be written."""

from __future__ import annotations

from robotd.api import IoDriver, NotReady, Unsupported
from robotd_replay.device import IMAGE_BYTES, ReplayDevice


class ReplayIo(IoDriver):
    """The I/O image as it was. Reads of what was not recorded raise NotReady."""

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
        self._require("input", byte, length, self._device.recorded_inputs)
        return bytes(self._device.inputs[byte : byte + length])

    def read_outputs(self, byte: int, length: int) -> bytes:
        self._require("output", byte, length, self._device.recorded_outputs)
        return bytes(self._device.outputs[byte : byte + length])

    def write_outputs(self, byte: int, data: bytes) -> None:
        raise Unsupported("outputs of a recording")

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        raise Unsupported("outputs of a recording")

    @staticmethod
    def _require(kind: str, byte: int, length: int, recorded: int) -> None:
        if byte + length > recorded:
            has = f"the first {recorded}" if recorded else "none"
            raise NotReady(
                f"{kind} byte {byte + length - 1} is not in the recording, which has {has}"
            )
