"""I/O driver over the image of all I/O modules of a fieldbus."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Generic, TypeVar

from robotd.api import InvalidArgument, IoDriver, NotReady
from robotd_cia402.node import FieldbusNode
from robotd_cia402.options import ModuleOptions

NodeT = TypeVar("NodeT", bound=FieldbusNode)
OptionsT = TypeVar("OptionsT", bound=ModuleOptions)


class ModuleIo(IoDriver, Generic[NodeT, OptionsT]):
    """Inputs received last, and outputs written last, of all modules. Any thread.

    A write to a byte without a module is rejected.
    """

    def __init__(self, modules: Sequence[tuple[NodeT, OptionsT]]) -> None:
        self.modules = modules
        options = [module for _, module in modules]
        self.inputs = bytearray(max((m.input_byte + m.input_length for m in options), default=0))
        self.outputs = bytearray(max((m.output_byte + m.output_length for m in options), default=0))
        self._lock = threading.Lock()

    @property
    def input_bytes(self) -> int:
        return len(self.inputs)

    @property
    def output_bytes(self) -> int:
        return len(self.outputs)

    @property
    def live(self) -> tuple[memoryview, memoryview]:
        return memoryview(self.inputs), memoryview(self.outputs)

    def read_inputs(self, byte: int, length: int) -> bytes:
        return bytes(self.inputs[byte : byte + length])

    def read_outputs(self, byte: int, length: int) -> bytes:
        return bytes(self.outputs[byte : byte + length])

    def write_outputs(self, byte: int, data: bytes) -> None:
        with self._lock:
            modules = self._online_modules(byte, len(data))
            self.outputs[byte : byte + len(data)] = data
            self._send(modules)

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        with self._lock:
            modules = self._online_modules(byte, 1)
            self.outputs[byte] = self.outputs[byte] & ~(1 << bit) | (int(value) << bit)
            self._send(modules)

    def _send(self, modules: Sequence[tuple[NodeT, OptionsT]]) -> None:
        """Send changed outputs, where the next cyclic frame does not carry them by itself.

        Raises OperationError with the modules to which sending failed.
        """

    def _online_modules(self, byte: int, length: int) -> list[tuple[NodeT, OptionsT]]:
        found = [
            (node, module)
            for node, module in self.modules
            if module.output_byte < byte + length
            and byte < module.output_byte + module.output_length
        ]
        if not found:
            raise InvalidArgument(f"no module serves output bytes {byte}..{byte + length - 1}")
        for node, _ in found:
            if not node.online:
                raise NotReady(node.complaint)
        return found
