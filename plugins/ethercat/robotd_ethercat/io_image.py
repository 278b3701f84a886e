"""Digital I/O of all modules, as one image."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

from robotd_ethercat.options import IoOptions
from robotd_ethercat.slave import Slave


class IoImage:
    """Inputs received last, and outputs that are sent in each period.

    ``pack`` and ``take`` belong to the control loop, the others to any thread.
    """

    def __init__(self, slaves: Sequence[Slave]) -> None:
        self.modules = [(slave, slave.module) for slave in slaves if slave.module is not None]
        options = [module for _, module in self.modules]
        self.inputs = bytearray(max((m.input_byte + m.input_length for m in options), default=0))
        self.outputs = bytearray(max((m.output_byte + m.output_length for m in options), default=0))
        self._lock = threading.Lock()
        self._raw: list[tuple[IoOptions, Any]] = []

    def begin(self, raw_slaves: Sequence[Any]) -> None:
        """Worker: the modules are configured; all outputs are off, as in SafeOp."""
        self.outputs[:] = bytes(len(self.outputs))
        self._raw = [(module, raw_slaves[slave.number]) for slave, module in self.modules]

    def clear(self, slave: Slave) -> None:
        """Switch the outputs of a lost module off: its return must not switch them on."""
        for each, module in self.modules:
            if each is slave:
                self.write(module.output_byte, bytes(module.output_length))

    def take(self) -> None:
        """Copy the inputs of all modules."""
        for module, raw in self._raw:
            first, length = module.input_byte, module.input_length
            if length:
                self.inputs[first : first + length] = raw.input[:length]

    def pack(self) -> None:
        """Hand over the outputs of all modules."""
        for module, raw in self._raw:
            first, length = module.output_byte, module.output_length
            if length:
                raw.output = bytes(self.outputs[first : first + length])

    def write(self, byte: int, data: bytes) -> None:
        """Write whole bytes."""
        with self._lock:
            self.outputs[byte : byte + len(data)] = data

    def write_bit(self, byte: int, bit: int, *, value: bool) -> None:
        """Write one bit, its neighbours untouched."""
        with self._lock:
            self.outputs[byte] = self.outputs[byte] & ~(1 << bit) | (int(value) << bit)

    def modules_of(self, byte: int, length: int) -> list[Slave]:
        """Return the modules that serve the output bytes."""
        return [
            slave
            for slave, module in self.modules
            if module.output_byte < byte + length
            and byte < module.output_byte + module.output_length
        ]
