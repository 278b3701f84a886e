"""Inputs and outputs of a recording; outputs cannot be written."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from robotd.api import IoDriver, Unsupported
from robotd_replay.device import ReplayDevice

SIZE = 8000  # bytes of each image; the recording has the first of them
Change = tuple[int, bytes]


class ReplayIo(IoDriver):
    """The I/O image as it was; zeros where nothing was recorded."""

    def __init__(self, device: ReplayDevice) -> None:
        self._device = device

    @property
    def input_bytes(self) -> int:
        return SIZE

    @property
    def output_bytes(self) -> int:
        return SIZE

    def read_inputs(self, byte: int, length: int) -> bytes:
        return self._bytes(self._device.replayed.recording.inputs, byte, length)

    def read_outputs(self, byte: int, length: int) -> bytes:
        return self._bytes(self._device.replayed.recording.outputs, byte, length)

    def write_outputs(self, byte: int, data: bytes) -> None:
        raise Unsupported("outputs of a recording")

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        raise Unsupported("outputs of a recording")

    def _bytes(self, changes: Sequence[Change], byte: int, length: int) -> bytes:
        """Return bytes of the last change; of the first one before it."""
        if not changes:
            return bytes(length)
        last = bisect_right(changes, self._device.recorded_ns(), key=lambda change: change[0])
        data = changes[max(0, last - 1)][1]
        return data[byte : byte + length].ljust(length, b"\0")
