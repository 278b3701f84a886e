"""Values received from the drives, in arrays filled by the receive thread."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from robotd_canopen.bus import Handler
from robotd_canopen.layout import AxisLayout
from robotd_canopen.pdo import Pdo
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import INPUTS, MODE_DISPLAY, POSITION
from robotd_cia402.scaling import PositionPlausibility, Scaling

_ALLOWED_MISSES = 5  # turns in a row that a TPDO may miss, however short they are
_REPORT_BEFORE = 0.8  # of the age at which values are stale: the error names a node, not an age
_HORIZON = 2  # times the age at which a TPDO is stale
_PROBATION_SYNCS = 10  # SYNCs for which the TPDOs of a drive are counted before it may be energised
_SLACK = 2  # frames beyond one for each turn: of the SYNC before, and not yet counted
_NEVER = -1
_NO_TURN = 1 << 40  # SYNCs: an event-driven TPDO has no turn, and is never late

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


class Feedback:
    """Values of n axes by object, in the drives' units.

    The receive thread writes single elements; the control loop takes them all before it sends a
    SYNC, so that all belong to the SYNC before. Age is counted in SYNCs: without a SYNC a drive
    has nothing to answer.

    Frames of an axis count from ``accept`` on: those of a drive that starts by itself may have
    another layout, and those of an earlier connection are old.

    Attributes:
        values: for each axis those of the objects in ``INPUTS``, as the control loop has taken
            them; 0 without a TPDO.
        pdos: TPDOs that an axis must have sent before it is known: the synchronous ones, and the
            event-driven ones that hold an object of ``INPUTS``; as (axis, PDO).
        seen: number of the SYNC after which each of ``pdos`` came last, -1: never; likewise.
        limits: SYNCs without it after which each of ``pdos`` is stale.
        syncs: SYNCs sent; counted by the control loop.
    """

    def __init__(self, axes: Sequence[AxisLayout], sync_period_s: float, stale_s: float) -> None:
        count = len(axes)
        self._arrived: IntArray = np.zeros((len(INPUTS) + 1, count), np.int64)
        self.values: list[list[int]] = self._arrived[:-1].T.tolist()
        self._complete = [False] * count
        self.pdos = [
            (number, pdo)
            for number, axis in enumerate(axes)
            for pdo in axis.tpdos
            if not pdo.is_event_driven or pdo.inputs
        ]
        self._positions = [_NEVER] * count  # place of the synchronous PDO with the position
        for slot, (number, pdo) in enumerate(self.pdos):
            if pdo.holds(POSITION) and not pdo.is_event_driven:
                self._positions[number] = slot
        self._accepts = [False] * count
        self._accepted = [0] * count  # number of the SYNC at ``accept``
        self._frames = [0] * len(self.pdos)  # of each PDO since then
        self._seeding = threading.Lock()  # between an event-driven TPDO and values read by SDO
        self._owners = np.array([number for number, _ in self.pdos], np.int64)
        self._seen: IntArray = np.full(len(self.pdos), _NEVER, np.int64)
        self.seen = self._seen.copy()
        turns = [_NO_TURN if pdo.is_event_driven else pdo.transmission for _, pdo in self.pdos]
        self._turns = np.array(turns, np.int64)
        least = math.floor(_REPORT_BEFORE * stale_s / sync_period_s)
        self.limits: IntArray = np.maximum(self._turns * _ALLOWED_MISSES, least)
        self.syncs = 0
        self._sync_period_s = sync_period_s

    def handler(self, axis: int, pdo: Pdo, scaling: Scaling) -> Handler:
        """Receives one TPDO of one axis.

        It raises ValueError, and takes nothing of it, for a frame that is too short or whose
        position is implausible. Event-driven PDOs are not checked: their rate is not known.
        """
        size, unpack = pdo.layout.size, pdo.layout.unpack_from
        arrived = dict(zip(INPUTS, self._arrived, strict=False))
        columns = [arrived.get(entry.base, self._arrived[-1]) for entry in pdo.entries]
        known = (axis, pdo) in self.pdos
        slot, seen = (self.pdos.index((axis, pdo)), self._seen) if known else (0, np.zeros(1))
        accepts, plausibility, position = self._accepts, None, 0
        frames = self._frames if known else [0]
        if not pdo.is_event_driven and pdo.holds(POSITION):
            horizon_s = _HORIZON * float(self.limits[slot]) * self._sync_period_s
            plausibility = PositionPlausibility(
                scaling, horizon_s, partial(self._is_new_position, axis, slot)
            )
            position = [entry.base for entry in pdo.entries].index(POSITION)

        def receive(data: bytearray) -> None:
            if not accepts[axis]:
                return
            if len(data) < size:
                raise ValueError(f"{pdo.name} has {len(data)} bytes, {size} are mapped")
            values = unpack(data)
            if plausibility is not None:
                plausibility.check(values[position])
            number = 0
            for value in values:
                columns[number][axis] = value
                number += 1  # noqa: SIM113 - for each frame of the bus: enumerate costs more
            seen[slot] = self.syncs
            frames[slot] += 1

        def receive_event(data: bytearray) -> None:
            with self._seeding:
                receive(data)

        return receive_event if pdo.is_event_driven else receive

    def _is_new_position(self, axis: int, slot: int) -> bool:
        """Return True if the position need not be near the one before."""
        mode = self._arrived[INPUTS.index(MODE_DISPLAY)][axis]
        return bool(self._seen[slot] == _NEVER or mode == OperationMode.HOMING)

    def take(self) -> None:
        """Control loop: take the values received so far.

        Their age is taken first: a frame that comes between is newer than it seems, not older.
        """
        self.seen[:] = self._seen
        self.values = self._arrived[:-1].T.tolist()  # numpy elements cost more to read

    def forget(self, axis: int) -> None:
        """Discard the values of a drive that is configured again, and frames until ``accept``."""
        self._accepts[axis] = False
        self._seen[self._owners == axis] = self.seen[self._owners == axis] = _NEVER
        self._complete[axis] = False

    def accept(self, axis: int) -> None:
        """Worker: the drive is configured and starts; its frames count from now on."""
        self._accepted[axis] = self.syncs
        for slot, (owner, _) in enumerate(self.pdos):
            if owner == axis:
                self._frames[slot] = 0
        self._accepts[axis] = True

    def is_counted(self, axis: int) -> bool:
        """Return True when enough SYNCs have passed for ``doubled``. Any thread."""
        return self.syncs - self._accepted[axis] >= _PROBATION_SYNCS

    def doubled(self, axis: int) -> Pdo | None:
        """Return a synchronous TPDO that comes more often than its turn; None: there is none.

        One drive answers a SYNC once, so that another one sends it, too. Any thread.
        """
        syncs = self.syncs - self._accepted[axis]
        for slot, (owner, pdo) in enumerate(self.pdos):
            if owner != axis or pdo.is_event_driven:
                continue
            if self._frames[slot] > syncs // max(1, int(self._turns[slot])) + _SLACK:
                return pdo
        return None

    def event_driven(self, axis: int) -> list[Pdo]:
        """Return the event-driven TPDOs that ``axis`` needs to be known. Any thread."""
        return [pdo for number, pdo in self.pdos if number == axis and pdo.is_event_driven]

    def has_come(self, axis: int, pdo: Pdo) -> bool:
        """Return True if ``pdo`` has come since ``accept``. Any thread."""
        return bool(self._seen[self.pdos.index((axis, pdo))] != _NEVER)

    def seed(self, axis: int, pdo: Pdo, values: Mapping[int, int]) -> None:
        """Worker: take values of an event-driven TPDO, unless it has come meanwhile.

        Args:
            values: by object of ``INPUTS``, as read by SDO after ``accept``.
        """
        with self._seeding:
            if not self.has_come(axis, pdo):
                for base, value in values.items():
                    self._arrived[INPUTS.index(base)][axis] = value
                self._seen[self.pdos.index((axis, pdo))] = self.syncs

    def complete(self, axis: int) -> bool:
        """Return True once every one of ``pdos`` of ``axis`` has come. Control loop."""
        if not self._complete[axis]:
            self._complete[axis] = not any(self.missing(axis))
        return self._complete[axis]

    def answered(self, axis: int) -> int:
        """Return the number of the SYNC that the position taken last answers. Control loop.

        An event-driven position is valid now: it comes only when it changes.
        """
        slot = self._positions[axis]
        return self.syncs if slot == _NEVER else int(self.seen[slot])

    def missing(self, axis: int) -> Iterator[Pdo]:
        """Yield the TPDOs of ``axis`` that have not come. Control loop."""
        for slot in ((self._owners == axis) & (self.seen == _NEVER)).nonzero()[0]:
            yield self.pdos[slot][1]

    def stale(self) -> list[tuple[int, Pdo, int]]:
        """Return axis, PDO and missed SYNCs of every stale TPDO. Control loop."""
        age = self.syncs - self.seen
        late = (age > self.limits) & (self.seen != _NEVER)
        if not late.any():
            return []
        return [(*self.pdos[slot], int(age[slot])) for slot in late.nonzero()[0]]

    def overdue(self, axis: int) -> bool:
        """Return True if a synchronous TPDO of ``axis`` is overdue."""
        late = self.syncs - self.seen > self._turns + 1
        return bool(late[self._owners == axis].any())

    def behind(self, offline: BoolArray) -> int:
        """Count the latest SYNCs that the slowest drive has not answered. Control loop.

        All SYNCs without a drive. Drives of ``offline`` axes (n,) do not count, nor do SYNCs before
        the next turn of a TPDO.
        """
        known = (self.seen != _NEVER) & ~offline[self._owners]
        last = self.seen + self._turns - 1
        return max(0, self.syncs - int(last[known].min())) if known.any() else self.syncs
