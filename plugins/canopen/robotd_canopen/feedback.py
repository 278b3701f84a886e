"""Values received from the drives, in arrays filled by the receive thread."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from robotd_canopen.bus import Handler
from robotd_canopen.layout import AxisLayout
from robotd_canopen.pdo import Pdo
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import DEMAND, INPUTS, MODE_DISPLAY, POSITION
from robotd_cia402.plausibility import PositionPlausibility
from robotd_cia402.scaling import Scaling

_ALLOWED_MISSES = 5  # turns in a row that a TPDO may miss, however short they are
_REPORT_BEFORE = 0.8  # of the age at which values are stale: the error names a node, not an age
_HORIZON = 2  # times the age at which a TPDO is stale
_WINDOW_SYNCS = 10  # for which the frames of each TPDO are counted
_FAST = 1.5  # frames for each turn: of two drives there are two
_FAST_WINDOWS = 4  # in a row; answers that had waited, and come at once, fill one or two
_OWED = 500  # frames that are missing, and may come late: 2 s at 250 Hz
SECOND_SYNC = "another node sends SYNC (COB-ID 0x080), too: clear bit 30 of its object 0x1005"
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
        missed: SYNCs in a row that each axis should have answered by ``take``, and has not.
        seen: number of the SYNC after which each of ``pdos`` came last, -1: never; likewise.
        limits: SYNCs without it after which each of ``pdos`` is stale.
        syncs: SYNCs sent, and those withheld; counted by the control loop.
        is_synchronous: one of ``pdos`` at least answers SYNCs.
        windows: finished windows, in each of which the frames of every PDO are counted.
        second_sync: SYNCs of another producer came in the latest window.
        echoes: the interface returns the frames that it sends, SYNC too.
    """

    def __init__(self, axes: Sequence[AxisLayout], sync_period_s: float, stale_s: float) -> None:
        count = len(axes)
        self._arrived: IntArray = np.zeros((len(INPUTS) + 1, count), np.int64)
        self.values: list[list[int]] = self._arrived[:-1].T.tolist()
        self._complete = [False] * count
        self._none_missed = [0] * count
        self.missed = self._none_missed
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
        self._plausibilities: list[list[PositionPlausibility]] = [[] for _ in axes]
        self._accepts = [False] * count
        self.windows = self._window_began = 0  # the latter: number of a SYNC
        self._accepted = [0] * count  # number of the window in which ``accept`` was
        self._frames = [0] * len(self.pdos)  # of each PDO
        self._frames_before = [0] * len(self.pdos)  # at the beginning of the window
        self._short: dict[int, int] = {}  # place of a PDO → bytes of its latest frame, too few
        self.second_sync = self.echoes = False
        self._syncs_come = self._foreign = 0  # the latter: the most that were not echoes
        self._fast = [0] * len(self.pdos)  # windows in a row with too many frames
        self._owed = [0.0] * len(self.pdos)  # frames that have not come for their SYNCs
        self._seeding = threading.Lock()  # between an event-driven TPDO and values read by SDO
        self._owners = np.array([number for number, _ in self.pdos], np.int64)
        self._seen: IntArray = np.full(len(self.pdos), _NEVER, np.int64)
        self.seen = self._seen.copy()
        turns = [_NO_TURN if pdo.is_event_driven else pdo.transmission for _, pdo in self.pdos]
        self._turns = np.array(turns, np.int64)
        self.is_synchronous = any(not pdo.is_event_driven for _, pdo in self.pdos)
        least = math.floor(_REPORT_BEFORE * stale_s / sync_period_s)
        self.limits: IntArray = np.maximum(self._turns * _ALLOWED_MISSES, least)
        self.syncs = 0
        self._sync_period_s = sync_period_s

    def handler(self, axis: int, pdo: Pdo, scaling: Scaling) -> Handler:
        """Receives one TPDO of one axis.

        It raises ValueError, and takes nothing of it, for a frame that is too short or whose
        position is implausible; the first one of a drive waits for one that confirms it.
        Event-driven PDOs are not checked: their rate is not known.
        """
        size, unpack = pdo.layout.size, pdo.layout.unpack_from
        arrived = dict(zip(INPUTS, self._arrived, strict=False))
        columns = [arrived.get(entry.base, self._arrived[-1]) for entry in pdo.entries]
        known = (axis, pdo) in self.pdos
        slot, seen = (self.pdos.index((axis, pdo)), self._seen) if known else (0, np.zeros(1))
        accepts, plausibility, position = self._accepts, None, 0
        modes = arrived[MODE_DISPLAY]
        frames, short = (self._frames, self._short) if known else ([0], dict[int, int]())
        checked = POSITION if pdo.holds(POSITION) else DEMAND  # both become commands
        if not pdo.is_event_driven and pdo.holds(checked):
            horizon_s = _HORIZON * float(self.limits[slot]) * self._sync_period_s
            plausibility = PositionPlausibility(scaling, horizon_s)
            self._plausibilities[axis].append(plausibility)
            position = [entry.base for entry in pdo.entries].index(checked)

        def receive(data: bytearray) -> None:
            if not accepts[axis]:
                return
            if len(data) < size:
                short[slot] = len(data)
                raise ValueError(f"{pdo.name} has {len(data)} bytes, {size} are mapped")
            values = unpack(data)
            if plausibility is not None:
                may_jump = seen[slot] == _NEVER or modes[axis] == OperationMode.HOMING
                may_jump |= checked == DEMAND  # of a drive that is switched on elsewhere
                if not plausibility.check(values[position], may_jump=may_jump):
                    return
            number = 0
            for value in values:
                columns[number][axis] = value
                number += 1  # noqa: SIM113 - for each frame of the bus: enumerate costs more
            seen[slot] = self.syncs
            frames[slot] += 1
            if short:
                short.pop(slot, None)

        def receive_event(data: bytearray) -> None:
            with self._seeding:
                receive(data)

        return receive_event if pdo.is_event_driven else receive

    def take(self) -> None:
        """Control loop: take the values received so far.

        Their age is taken first: a frame that comes between is newer than it seems, not older.
        """
        self.seen[:] = self._seen
        if self.syncs - self._window_began >= _WINDOW_SYNCS:
            self._end_window()
        self.values = self._arrived[:-1].T.tolist()  # numpy elements cost more to read
        self.missed = self._none_missed
        late = self.syncs - self.seen - self._turns + 1
        late[self.seen == _NEVER] = 0
        if np.count_nonzero(late > 0):
            self.missed = [
                max(0, int(late[self._owners == axis].max(initial=0)))
                for axis in range(len(self._complete))
            ]

    def forget(self, axis: int) -> None:
        """Discard the values of a drive that is configured again, and frames until ``accept``."""
        self._accepts[axis] = False
        for plausibility in self._plausibilities[axis]:
            plausibility.forget()
        self._seen[self._owners == axis] = self.seen[self._owners == axis] = _NEVER
        self._complete[axis] = False

    def accept(self, axis: int) -> None:
        """Worker: the drive is configured and starts; its frames count from now on."""
        self._accepted[axis] = self.windows
        for slot in np.flatnonzero(self._owners == axis).tolist():
            self._short.pop(slot, None)
            self._owed[slot] = 0.0  # what is missing until now was not accepted
        self._accepts[axis] = True

    def is_counted(self, axis: int, since: int = 0) -> bool:
        """Return True when ``doubled`` is sure. Any thread.

        That is after a whole window since ``accept`` in which no TPDO has come too often, or
        enough of those in which one has.

        Args:
            since: ``windows`` at which a further one begins to count.
        """
        if self.windows <= max(since, self._accepted[axis] + 1):
            return False
        fast = [
            count for count, (owner, _) in zip(self._fast, self.pdos, strict=True) if owner == axis
        ]
        return not any(0 < count < _FAST_WINDOWS for count in fast)

    def doubled(self, axis: int) -> Pdo | None:
        """Return a synchronous TPDO that comes more often than its turn; None: there is none.

        One drive answers a SYNC once, so that another one sends it, too. Answers that have waited
        while the drive, or this computer, stood still come too often as well: there are no more of
        them than were missing before, up to ``_OWED``. Any thread.
        """
        for count, (owner, pdo) in zip(self._fast, self.pdos, strict=True):
            if owner == axis and count >= _FAST_WINDOWS:
                return pdo
        return None

    def _end_window(self) -> None:
        """Judge how often each synchronous TPDO has come in a window, and begin the next one."""
        syncs, frames = self.syncs - self._window_began, list(self._frames)
        for slot, turn in enumerate(self._turns.tolist()):
            came, due = frames[slot] - self._frames_before[slot], syncs / turn
            owed = self._owed[slot] + due - came
            is_fast = turn != _NO_TURN and owed < 0.0 and came > _FAST * due
            self._owed[slot] = min(max(owed, 0.0), _OWED)
            self._fast[slot] = self._fast[slot] + 1 if is_fast else 0
        foreign = self._syncs_come - (self.syncs if self.echoes else 0)  # echoes may be late
        self.second_sync, self._foreign = foreign > self._foreign, max(foreign, self._foreign)
        self._frames_before = frames
        self._window_began = self.syncs
        self.windows += 1

    def note_sync(self, _: bytearray) -> None:
        """Receive thread: a SYNC has come, of another producer or as an echo."""
        self._syncs_come += 1

    def name(self, axis: int, pdo: Pdo) -> str:
        """Return ``TPDO 1``, and that its latest frame was shorter than mapped. Any thread."""
        size = self._short.get(self.pdos.index((axis, pdo)))
        if size is None:
            return pdo.name
        return f"{pdo.name} (shorter than mapped: {size} of {pdo.layout.size} bytes)"

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

    def note_mode(self, axis: int, shown: int) -> None:
        """Worker: take a mode display that was read by SDO, because no TPDO holds it."""
        self._arrived[INPUTS.index(MODE_DISPLAY)][axis] = shown

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

    @property
    def unanswered(self) -> int:
        """Latest SYNCs that no drive has answered; 0 without a drive. Control loop."""
        last = np.where(self.seen == _NEVER, _NEVER, self.seen + self._turns - 1)
        latest = int(last.max(initial=_NEVER, where=self._turns != _NO_TURN))
        return 0 if latest == _NEVER else max(0, self.syncs - latest)

    def behind(self, offline: BoolArray) -> int:
        """Count the latest SYNCs that the slowest drive has not answered. Control loop.

        All SYNCs without a drive. Drives of ``offline`` axes (n,) do not count, nor do SYNCs before
        the next turn of a TPDO.
        """
        known = (self.seen != _NEVER) & ~offline[self._owners]
        last = self.seen + self._turns - 1
        return max(0, self.syncs - int(last[known].min())) if known.any() else self.syncs
