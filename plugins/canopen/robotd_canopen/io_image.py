"""Digital I/O of all CiA 401 modules, as one image."""

from __future__ import annotations

import threading
from collections.abc import Collection, Sequence

from robotd.api import NotReady, OperationError
from robotd_canopen.bus import Bus, Handler
from robotd_canopen.frame import Frame
from robotd_canopen.layout import IoLayout
from robotd_canopen.node import Node
from robotd_canopen.options import IoOptions
from robotd_canopen.sync_gate import SyncGate
from robotd_cia402.module_io import ModuleIo

_INPUTS, _OUTPUTS = 0x6000, 0x6200


class IoImage(ModuleIo[Node, IoOptions]):
    """Inputs come, and outputs are sent, when they change.

    While ``gate`` is closed writes are rejected: the outputs could be switched much later.
    """

    def __init__(self, bus: Bus, modules: Sequence[tuple[Node, IoLayout]], gate: SyncGate) -> None:
        super().__init__([(node, layout.options) for node, layout in modules])
        self._bus, self._gate = bus, gate
        self._rpdos = {node.number: layout.rpdos for node, layout in modules}
        self._known: set[Node] = set()  # modules whose levels were read
        self._received: set[Node] = set()  # modules that have sent inputs since they were read
        self._reading = threading.Lock()  # between received inputs and those read by SDO
        for node, layout in modules:
            for pdo in layout.tpdos:
                bus.subscribe(pdo.cob_id, self._handler(node, layout.options))

    def forget(self, nodes: Collection[Node]) -> None:
        """Worker: the ``nodes`` are started again; what is known of them may be old."""
        self._known.difference_update(nodes)

    def start(self) -> None:
        """Read inputs and outputs of the modules that have started: no output is switched."""
        for node, options in self.modules:
            if node in self._known or not node.online:
                continue
            sdo = node.sdo
            self._received.discard(node)
            read = [sdo.read(_INPUTS, sub) & 0xFF for sub in range(1, options.input_length + 1)]
            with self._reading:
                if node not in self._received:  # else: what it has sent is newer
                    self.inputs[options.input_byte : options.input_byte + len(read)] = bytes(read)
            levels = [sdo.read(_OUTPUTS, sub) & 0xFF for sub in range(1, options.output_length + 1)]
            with self._lock:
                self.outputs[options.output_byte : options.output_byte + len(levels)] = levels
                self._known.add(node)

    def _online_modules(self, byte: int, length: int) -> list[tuple[Node, IoOptions]]:
        found = super()._online_modules(byte, length)
        if self._gate.is_closed:
            text = "no drive answers, and outputs could wait in the CAN adapter"
            raise NotReady(f"{self._bus.name}: {text}: they are not sent")
        for node, _ in found:
            if node not in self._known:  # a frame has all outputs of the module, old ones as well
                raise NotReady(f"{node.name}: its outputs are not known yet")
        return found

    def _send(self, modules: Sequence[tuple[Node, IoOptions]]) -> None:
        failed = []
        for node, options in modules:
            first = options.output_byte
            data = bytes(self.outputs[first : first + options.output_length])
            if not all(self._bus.send(Frame(p.cob_id, data)) for p in self._rpdos[node.number]):
                failed.append(node.name)
        if failed:
            names = ", ".join(failed)
            raise OperationError(f"outputs were not sent to {names}: {self._bus.fault}")

    def _handler(self, node: Node, options: IoOptions) -> Handler:
        first, length = options.input_byte, options.input_length

        def receive(data: bytearray) -> None:
            if not node.configured:
                return  # of a module that starts by itself, perhaps with another mapping
            if len(data) < length:
                raise ValueError(f"inputs have {len(data)} bytes, {length} are mapped")
            with self._reading:
                self._received.add(node)
                self.inputs[first : first + length] = data[:length]

        return receive
