"""I/O driver over the image of the modules."""

from __future__ import annotations

from robotd.api import InvalidArgument, IoDriver, NotReady, OperationError
from robotd_canopen.master import Master


class CanopenIo(IoDriver):
    """Bytes of CiA 401 modules; a write to a byte without a module is rejected."""

    def __init__(self, master: Master) -> None:
        self._master, self._image = master, master.io

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
        self._check(self._image.write(byte, data))

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        self._require_modules(byte, 1)
        self._check(self._image.write_bit(byte, bit, value=value))

    def _require_modules(self, byte: int, length: int) -> None:
        nodes = self._image.nodes_of_outputs(byte, length)
        if not nodes:
            raise InvalidArgument(f"no module serves output bytes {byte}..{byte + length - 1}")
        for number in nodes:
            node = self._master.nodes[number]
            if not node.online:
                raise NotReady(node.complaint)

    def _check(self, failed: list[int]) -> None:
        if failed:
            names = ", ".join(self._master.nodes[number].name for number in failed)
            raise OperationError(f"outputs were not sent to {names}: {self._master.bus.fault}")
