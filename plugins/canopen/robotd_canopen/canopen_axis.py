"""One axis on a CAN bus, and the objects of its drive."""

from __future__ import annotations

from collections.abc import Sequence

from robotd_canopen.feedback import Feedback
from robotd_canopen.layout import AxisLayout
from robotd_canopen.node import Node
from robotd_canopen.rpdo_writer import RpdoWriter
from robotd_cia402.axis import Axis
from robotd_cia402.emcy import Emergency
from robotd_cia402.scaling import Scaling


class CanopenObjects:
    """``CyclicObjects`` of one axis, by PDOs and SDO; a frame is a SYNC.

    Attributes:
        rpdos: the frames that carry the outputs.
    """

    def __init__(self, number: int, layout: AxisLayout, node: Node, feedback: Feedback) -> None:
        self.name = f"node {node.id}"
        self.rpdos = RpdoWriter(layout)
        self.inputs = frozenset(entry.base for pdo in layout.tpdos for entry in pdo.entries)
        self.outputs = frozenset(entry.base for pdo in layout.rpdos for entry in pdo.entries)
        self._number, self._layout, self._node = number, layout, node
        self._feedback = feedback

    @property
    def online(self) -> bool:
        return self._node.online

    @property
    def fault(self) -> str:
        return self._node.fault

    @property
    def known(self) -> bool:
        return self._node.online and self._feedback.complete(self._number)

    @property
    def frames(self) -> int:
        return self._feedback.syncs

    @property
    def emergency(self) -> Emergency | None:
        return self._node.emergency

    def put(self, values: Sequence[int]) -> None:
        self.rpdos.values = values

    def values(self) -> Sequence[int]:
        return self._feedback.values[self._number]

    def has(self, index: int) -> bool:
        return self._layout.index(index) in self._node.sdo.dictionary

    def read(self, index: int, sub: int = 0) -> int:
        return self._node.sdo.read(self._layout.index(index), sub)

    def write(self, index: int, sub: int, value: int) -> None:
        self._node.sdo.write(self._layout.index(index), sub, value)

    def forget(self) -> None:
        self._feedback.forget(self._number)


class CanopenAxis(Axis):
    """Axis ``number`` of the robot, on ``node``."""

    def __init__(
        self, number: int, layout: AxisLayout, node: Node, feedback: Feedback, scaling: Scaling
    ) -> None:
        objects = CanopenObjects(number, layout, node, feedback)
        super().__init__(number, layout.options, objects, scaling)
        self.layout, self.node, self.rpdos = layout, node, objects.rpdos
