"""Digital I/O of all CiA 401 modules, as one image."""

from __future__ import annotations

import threading
from collections.abc import Collection, Sequence

from robotd.api import OperationError
from robotd_canopen.bus import Bus, Handler
from robotd_canopen.frame import Frame
from robotd_canopen.layout import IoLayout
from robotd_canopen.node import Node

_INPUTS, _OUTPUTS = 0x6000, 0x6200


class IoImage:
    """Inputs received last, and outputs written last. Any thread."""

    def __init__(self, bus: Bus, modules: Sequence[tuple[Node, IoLayout]]) -> None:
        self._bus, self._modules = bus, modules
        options = [module.options for _, module in modules]
        ends = [(m.input_byte + m.input_length, m.output_byte + m.output_length) for m in options]
        self.inputs = bytearray(max((end for end, _ in ends), default=0))
        self.outputs = bytearray(max((end for _, end in ends), default=0))
        self._lock = threading.Lock()
        self._known: set[Node] = set()  # modules whose levels were read
        self._received: set[Node] = set()  # modules that have sent inputs since they were read
        self._reading = threading.Lock()  # between received inputs and those read by SDO
        for node, module in modules:
            for pdo in module.tpdos:
                bus.subscribe(pdo.cob_id, self._handler(node, module))

    def forget(self, nodes: Collection[Node]) -> None:
        """Worker: the ``nodes`` are started again; what is known of them may be old."""
        self._known.difference_update(nodes)

    def start(self) -> None:
        """Read inputs and outputs of the modules that have started: no output is switched."""
        for node, module in self._modules:
            if node in self._known or not node.online:
                continue
            options, sdo = module.options, node.sdo
            self._received.discard(node)
            read = [sdo.read(_INPUTS, sub) & 0xFF for sub in range(1, options.input_length + 1)]
            with self._reading:
                if node not in self._received:  # else: what it has sent is newer
                    self.inputs[options.input_byte : options.input_byte + len(read)] = bytes(read)
            for sub in range(1, options.output_length + 1):
                self.outputs[options.output_byte + sub - 1] = sdo.read(_OUTPUTS, sub) & 0xFF
            self._known.add(node)

    def write(self, byte: int, data: bytes) -> None:
        """Write whole bytes. Raises OperationError with the nodes to which sending failed."""
        with self._lock:
            self.outputs[byte : byte + len(data)] = data
            self._send(byte, len(data))

    def write_bit(self, byte: int, bit: int, *, value: bool) -> None:
        """Write one bit, its neighbours untouched. Raises OperationError as ``write``."""
        with self._lock:
            self.outputs[byte] = self.outputs[byte] & ~(1 << bit) | (int(value) << bit)
            self._send(byte, 1)

    def modules_of(self, byte: int, length: int) -> list[Node]:
        """Return the modules that serve the output bytes."""
        return [node for node, _ in self._of_outputs(byte, length)]

    def _of_outputs(self, byte: int, length: int) -> list[tuple[Node, IoLayout]]:
        return [
            (node, module)
            for node, module in self._modules
            if module.options.output_byte < byte + length
            and byte < module.options.output_byte + module.options.output_length
        ]

    def _send(self, byte: int, length: int) -> None:
        failed = []
        for node, module in self._of_outputs(byte, length):
            first = module.options.output_byte
            data = bytes(self.outputs[first : first + module.options.output_length])
            if not all(self._bus.send(Frame(pdo.cob_id, data)) for pdo in module.rpdos):
                failed.append(node.name)
        if failed:
            names = ", ".join(failed)
            raise OperationError(f"outputs were not sent to {names}: {self._bus.fault}")

    def _handler(self, node: Node, module: IoLayout) -> Handler:
        first, length = module.options.input_byte, module.options.input_length

        def receive(data: bytearray) -> None:
            if not node.configured:
                return  # of a module that starts by itself, perhaps with another mapping
            if len(data) < length:
                raise ValueError(f"inputs have {len(data)} bytes, {length} are mapped")
            with self._reading:
                self._received.add(node)
                self.inputs[first : first + length] = data[:length]

        return receive
