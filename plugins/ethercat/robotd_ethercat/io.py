"""I/O driver over the image of the modules."""

from __future__ import annotations

from robotd.api import InvalidArgument, IoDriver, NotReady
from robotd_ethercat.io_image import IoImage


class EthercatIo(IoDriver):
    """Bytes of I/O modules; a write to a byte without a module is rejected."""

    def __init__(self, image: IoImage) -> None:
        self._image = image

    @property
    def input_bytes(self) -> int:
        return len(self._image.inputs)

    @property
    def output_bytes(self) -> int:
        return len(self._image.outputs)

    @property
    def live(self) -> tuple[memoryview, memoryview]:
        return memoryview(self._image.inputs), memoryview(self._image.outputs)

    def read_inputs(self, byte: int, length: int) -> bytes:
        return bytes(self._image.inputs[byte : byte + length])

    def read_outputs(self, byte: int, length: int) -> bytes:
        return bytes(self._image.outputs[byte : byte + length])

    def write_outputs(self, byte: int, data: bytes) -> None:
        self._require_modules(byte, len(data))
        self._image.write(byte, data)

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        self._require_modules(byte, 1)
        self._image.write_bit(byte, bit, value=value)

    def _require_modules(self, byte: int, length: int) -> None:
        slaves = self._image.serving(byte, length)
        if not slaves:
            raise InvalidArgument(f"no module serves output bytes {byte}..{byte + length - 1}")
        for slave in slaves:
            if not slave.online:
                raise NotReady(slave.complaint)
