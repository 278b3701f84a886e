"""Objects of one axis on a CAN bus: PDOs with SYNC, and SDO."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robotd.api import DeviceTimeout, OperationError, wait_until
from robotd_canopen.bus import Bus
from robotd_canopen.feedback import SECOND_SYNC, Feedback
from robotd_canopen.frame import Frame
from robotd_canopen.layout import AxisLayout
from robotd_canopen.node import ANSWERS, FRAMES, Node
from robotd_canopen.object_dictionary import variable
from robotd_canopen.pdo import Entry, Pdo
from robotd_canopen.sync_gate import SyncGate
from robotd_cia402.drive_access import DriveAccess, SdoAbort
from robotd_cia402.modes import VELOCITY_MODES, OperationMode
from robotd_cia402.object_numbers import (
    CONTROLWORD,
    MODE,
    MODE_DISPLAY,
    OUTPUTS,
    POSITION,
    TARGET_VELOCITY,
    VELOCITY,
)

_EVENT_S = 1.0  # for an event-driven TPDO whose objects cannot be read
_FIRST_OBJECT = 0x1000  # below are types, which fill gaps of a mapping
_MODE = OUTPUTS.index(MODE)
_CONTROLWORD = OUTPUTS.index(CONTROLWORD)
_TARGET_VELOCITY = OUTPUTS.index(TARGET_VELOCITY)
_VELOCITY_MODES = frozenset(VELOCITY_MODES.values())
_SLOWER = 2  # a velocity that is lower by this factor does not wait for a probe
_CONNECTION_LOST = 0x6007  # reaction to it
_NOTHING_SENT = -1


@dataclass(frozen=True)
class _Rpdo:
    """One RPDO, with the frame that is sent again and again."""

    pdo: Pdo
    frame: Frame
    places: list[int]  # of its objects in OUTPUTS, or behind them
    modes: frozenset[int] | None  # as Pdo.modes


class CanopenDrive(DriveAccess):
    """Axis ``number`` of the robot, on ``node``; a cyclic frame is a SYNC.

    Mapped outputs that no part of robotd sets, such as a torque limit, keep the value that the
    drive had when it was configured.

    Attributes:
        layout: its options, dictionary and PDOs.
    """

    node: Node
    latency = 2  # sent before a SYNC, answered after it, taken before the next one
    settling = 2  # frames that waited arrive before these

    def __init__(
        self,
        number: int,
        layout: AxisLayout,
        node: Node,
        feedback: Feedback,
        bus: Bus,
        gate: SyncGate,
    ) -> None:
        super().__init__()
        self.node = node
        self.inputs = frozenset(entry.base for pdo in layout.tpdos for entry in pdo.entries)
        synchronous = [pdo for pdo in layout.tpdos if not pdo.is_event_driven]
        self.turn = max((pdo.transmission for pdo in synchronous), default=1)
        source = VELOCITY if VELOCITY in self.inputs else POSITION
        holding = [pdo.transmission for pdo in synchronous if pdo.holds(source)]
        self.velocity_turn = max(holding, default=1)
        self.outputs = frozenset(entry.base for pdo in layout.rpdos for entry in pdo.entries)
        self.layout, self._number = layout, number
        self.unreacting = self._unreacting(node)
        self._feedback, self._bus, self._gate = feedback, bus, gate
        self._waiting: Sequence[int] | None = None  # outputs that the gate withholds
        self._controlword = _NOTHING_SENT
        self._speed = 0  # as sent last; 0 in other modes than those of velocity
        entries = [entry for pdo in layout.rpdos for entry in pdo.entries]
        self._others = [entry for entry in entries if entry.base not in OUTPUTS]
        self._own_values = [0] * len(self._others)
        self._rpdos = [
            _Rpdo(
                pdo,
                Frame(pdo.cob_id, bytes(pdo.layout.size)),
                [self._place(entry) for entry in pdo.entries],
                pdo.modes,
            )
            for pdo in layout.rpdos
        ]

    @property
    def known(self) -> bool:
        return self.node.online and self._feedback.complete(self._number)

    @property
    def awaited(self) -> str:
        feedback, number = self._feedback, self._number
        names = [feedback.name(number, pdo) for pdo in feedback.missing(number)]
        return f"{', '.join(names)} not received yet"

    @property
    def frames(self) -> int:
        return self._feedback.syncs

    @property
    def answered(self) -> int:
        return self._feedback.answered(self._number)

    @property
    def missed(self) -> int:
        return self._feedback.missed[self._number]

    @property
    def blocked(self) -> bool:
        return self._gate.is_closed

    def put(self, values: Sequence[int]) -> None:
        """Send the RPDOs of this SYNC, to take effect with the next one.

        Also to a lost node that has kept its configuration: it may receive.
        """
        self._waiting = values if self.node.configured else None
        self.send_waiting()

    def send_waiting(self) -> None:
        """Send the outputs put last, unless they are sent or may not be sent yet."""
        values = self._waiting
        if values is None:
            return
        word, mode = values[_CONTROLWORD], values[_MODE]
        speed = abs(values[_TARGET_VELOCITY]) if mode in _VELOCITY_MODES else 0
        # Each such velocity is half of the one before, or less: there are few of them.
        slows = self._speed > 0 and speed * _SLOWER <= self._speed
        if not self._gate.admits(at_once=slows or word != self._controlword):
            return
        self._waiting, self._controlword, self._speed = None, word, speed
        values = (*values, *self._own_values)
        for rpdo in self._rpdos:
            if rpdo.modes is None or mode in rpdo.modes:
                data = [values[place] for place in rpdo.places]
                rpdo.pdo.layout.pack_into(rpdo.frame.data, 0, *data)
                self._bus.send(rpdo.frame)

    def values(self) -> Sequence[int]:
        return self._feedback.values[self._number]

    def writable(self, index: int, sub: int) -> bool:
        found = variable(self.node.sdo.dictionary, self.layout.index(index), sub)
        return found is not None and found.writable

    def read(self, index: int, sub: int = 0) -> int:
        return self.node.sdo.read(self.layout.index(index), sub)

    def write(self, index: int, sub: int, value: int) -> None:
        self.node.sdo.write(self.layout.index(index), sub, value)

    def note_mode(self, shown: int) -> None:
        super().note_mode(shown)
        if MODE_DISPLAY not in self.inputs:
            self._feedback.note_mode(self._number, shown)

    def forget(self) -> None:
        self._feedback.forget(self._number)
        self.note_mode(OperationMode.NONE)

    def accept(self) -> None:
        """Worker: the node is configured and starts; its TPDOs count from now on."""
        self._own_values = [self._own_value(entry) for entry in self._others]
        self._feedback.accept(self._number)

    def query(self) -> None:
        """Worker: read the values that an operational node sends on an event only.

        Nothing may change for hours, and until then they would be unknown. Raises OperationError
        and DeviceTimeout naming the object.
        """
        number, feedback, sdo = self._number, self._feedback, self.node.sdo
        for pdo in feedback.event_driven(number):
            if feedback.has_come(number, pdo):
                continue
            try:
                values = {entry.base: sdo.read(entry.index, entry.sub) for entry in pdo.inputs}
            except SdoAbort as error:
                if not self._comes(pdo):
                    raise OperationError(
                        f"first values: {pdo.name} is event-driven and has not come within"
                        f" {_EVENT_S:g} s, and {error.reason}"
                    ) from error
            else:
                feedback.seed(number, pdo, values)

    def require_unique(self, timeout_s: float) -> None:
        """Wait for some SYNCs first."""
        number, feedback, node = self._number, self._feedback, self.node
        since = feedback.windows
        counted = lambda: feedback.is_counted(number, since) or not node.online  # noqa: E731
        if not wait_until(counted, timeout_s, node.clock):
            text = f"too few SYNCs within {timeout_s:g} s to look for another node with its id"
            raise DeviceTimeout(f"{node.name}: {text}")
        if node.sdo.doubled:
            raise OperationError(f"{node.name}: {ANSWERS}")
        if feedback.second_sync:
            raise OperationError(f"{node.name}: {SECOND_SYNC}")
        if pdo := feedback.doubled(number):
            raise OperationError(f"{node.name}: {FRAMES.format(pdo.name)}")

    def _unreacting(self, node: Node) -> str:
        """Return why 0x6007 is not written, as far as files tell; "" if it is."""
        if _CONNECTION_LOST in self.layout.options.skip_writes:
            return "0x6007 is not written (skip_writes)"
        found = variable(node.sdo.dictionary, self.layout.index(_CONNECTION_LOST), 0)
        return "" if found is not None and found.writable else "0x6007 is missing or read-only"

    def _comes(self, pdo: Pdo) -> bool:
        return wait_until(
            lambda: self._feedback.has_come(self._number, pdo), _EVENT_S, self.node.clock
        )

    def _place(self, entry: Entry) -> int:
        """Return the place of an object in ``OUTPUTS``; behind them if robotd does not set it."""
        if entry.base in OUTPUTS:
            return OUTPUTS.index(entry.base)
        return len(OUTPUTS) + self._others.index(entry)

    def _own_value(self, entry: Entry) -> int:
        found = variable(self.node.sdo.dictionary, entry.index, entry.sub)
        readable = entry.index >= _FIRST_OBJECT and found is not None and found.readable
        return self.node.sdo.read(entry.index, entry.sub) if readable else 0
