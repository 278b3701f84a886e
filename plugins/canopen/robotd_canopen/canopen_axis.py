"""One axis on a CAN bus, and the objects of its drive."""

from __future__ import annotations

from collections.abc import Sequence

from robotd.api import OperationError, wait_until
from robotd_canopen.duplicate_id import ANSWERS, FRAMES
from robotd_canopen.feedback import Feedback
from robotd_canopen.layout import AxisLayout
from robotd_canopen.node import Node
from robotd_canopen.object_dictionary import variable
from robotd_canopen.pdo import Pdo
from robotd_canopen.rpdo_writer import RpdoWriter
from robotd_cia402.axes import Cia402Axes, Cia402Master
from robotd_cia402.axis import Axis
from robotd_cia402.cyclic_objects import SdoAbort
from robotd_cia402.emcy import Emergency
from robotd_cia402.scaling import Scaling

_EVENT_S = 1.0  # for an event-driven TPDO whose objects cannot be read


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
    def awaited(self) -> str:
        names = [pdo.name for pdo in self._feedback.missing(self._number)]
        return f"{', '.join(names)} not received yet"

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

    def writable(self, index: int, sub: int) -> bool:
        found = variable(self._node.sdo.dictionary, self._layout.index(index), sub)
        return found is not None and found.writable

    def read(self, index: int, sub: int = 0) -> int:
        return self._node.sdo.read(self._layout.index(index), sub)

    def write(self, index: int, sub: int, value: int) -> None:
        self._node.sdo.write(self._layout.index(index), sub, value)

    def forget(self) -> None:
        self._feedback.forget(self._number)

    def accept(self) -> None:
        """Worker: the node is configured and starts; its TPDOs count from now on."""
        self._feedback.accept(self._number)

    def query(self) -> None:
        """Worker: read the values that an operational node sends on an event only.

        Nothing may change for hours, and until then they would be unknown. Raises OperationError
        and DeviceTimeout naming the object.
        """
        for pdo in self._feedback.event_driven(self._number):
            try:
                self._query(pdo)
            except SdoAbort as error:
                if not self._comes(pdo):
                    raise OperationError(
                        f"first values: {pdo.name} is event-driven and has not come within"
                        f" {_EVENT_S:g} s, and {error.reason}"
                    ) from error

    def _query(self, pdo: Pdo) -> None:
        if not self._feedback.has_come(self._number, pdo):
            sdo = self._node.sdo
            values = {entry.base: sdo.read(entry.index, entry.sub) for entry in pdo.inputs}
            self._feedback.seed(self._number, pdo, values)

    def _comes(self, pdo: Pdo) -> bool:
        return wait_until(
            lambda: self._feedback.has_come(self._number, pdo), _EVENT_S, self._node.clock
        )


class CanopenAxis(Axis):
    """Axis ``number`` of the robot, on ``node``."""

    def __init__(
        self, number: int, layout: AxisLayout, node: Node, feedback: Feedback, scaling: Scaling
    ) -> None:
        objects = CanopenObjects(number, layout, node, feedback)
        super().__init__(number, layout.options, objects, scaling)
        self.layout, self.node, self.canopen, self.rpdos = layout, node, objects, objects.rpdos


class CanopenAxes(Cia402Axes):
    """All axes of one CAN bus.

    Args:
        axes: by axis number.
        feedback: of the same axes.
        master: of the bus.
    """

    def __init__(
        self, axes: Sequence[CanopenAxis], feedback: Feedback, master: Cia402Master
    ) -> None:
        super().__init__(master)
        self._of_bus, self._feedback, self._clock = axes, feedback, master.clock

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        if on:
            self._require_one_drive(axis, timeout_s)
        super().servo(axis, on, timeout_s)

    def _require_one_drive(self, axis: int, timeout_s: float) -> None:
        """Raise OperationError where two nodes have the id: positions of both would be mixed.

        An axis that is on goes on when the other node comes; switched off, it stays off.
        """
        node = self._of_bus[axis].node
        wait_until(
            lambda: self._feedback.is_counted(axis) or not node.online, timeout_s, self._clock
        )
        if node.sdo.doubled:
            raise OperationError(f"{node.name}: {ANSWERS}")
        if pdo := self._feedback.doubled(axis):
            raise OperationError(f"{node.name}: {FRAMES.format(pdo.name)}")
