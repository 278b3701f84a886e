"""I/O driver over the image of all I/O modules of a fieldbus."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from robotd.api import InvalidArgument, IoDriver, NotReady


class Module(Protocol):
    """Node of an I/O module. Any thread."""

    online: bool

    @property
    def complaint(self) -> str:
        """Name of the module, and why it is offline."""
        ...


class ModuleImage(Protocol):
    """Inputs received last, and outputs written last, of all modules. Any thread."""

    inputs: bytearray
    outputs: bytearray

    def write(self, byte: int, data: bytes) -> None:
        """Write whole bytes. Raises OperationError when they cannot be sent."""
        ...

    def write_bit(self, byte: int, bit: int, *, value: bool) -> None:
        """Write one bit, its neighbours untouched. Raises OperationError as ``write``."""
        ...

    def modules_of(self, byte: int, length: int) -> Sequence[Module]:
        """Return the modules that serve the output bytes."""
        ...


class ModuleIo(IoDriver):
    """Bytes of I/O modules; a write to a byte without a module is rejected."""

    def __init__(self, image: ModuleImage) -> None:
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
        modules = self._image.modules_of(byte, length)
        if not modules:
            raise InvalidArgument(f"no module serves output bytes {byte}..{byte + length - 1}")
        for module in modules:
            if not module.online:
                raise NotReady(module.complaint)
