"""Digital I/O of the slaves on an EtherCAT line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from robotd_cia402.module_io import ModuleIo
from robotd_ethercat.options import IoOptions
from robotd_ethercat.slave import Slave


class IoImage(ModuleIo[Slave, IoOptions]):
    """Outputs are sent in each period: ``pack`` and ``take`` belong to the control loop."""

    def __init__(self, slaves: Sequence[Slave]) -> None:
        super().__init__([(slave, slave.module) for slave in slaves if slave.module is not None])
        self._raw: list[tuple[IoOptions, Any]] = []

    def begin(self, raw_slaves: Sequence[Any]) -> None:
        """Worker: the modules are configured; all outputs are off, as in SafeOp."""
        self.outputs[:] = bytes(len(self.outputs))
        self._raw = [(module, raw_slaves[slave.number]) for slave, module in self.modules]

    def clear(self, slave: Slave) -> None:
        """Switch the outputs of a lost module off: its return must not switch them on."""
        for owner, module in self.modules:
            if owner is slave:
                first, length = module.output_byte, module.output_length
                with self._lock:
                    self.outputs[first : first + length] = bytes(length)

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
