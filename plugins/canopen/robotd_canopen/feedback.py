"""What the drives said last: arrays that the receive thread fills, frame by frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robotd_canopen.bus import Handler
from robotd_canopen.layout import AxisLayout
from robotd_canopen.pdo import Pdo
from robotd_canopen.scaling import SPAN

STATUSWORD, MODE, POSITION, DEMAND = 0x6041, 0x6061, 0x6064, 0x6062
VELOCITY, TORQUE, ERROR_CODE, INPUTS = 0x606C, 0x6077, 0x603F, 0x60FD
_OBJECTS = (STATUSWORD, MODE, POSITION, DEMAND, VELOCITY, TORQUE, ERROR_CODE, INPUTS)
_ALLOWED_MISSES = 5  # a TPDO may be late by this many of its turns before it can be stale
_EVENT_DRIVEN = 240

IntArray = NDArray[np.int64]


class Feedback:
    """Values of n axes by object, in the drives' units; -1 in ``times_ns`` is "never".

    The receive thread writes single elements, the cycle reads whole arrays.

    Attributes:
        columns: object → array of shape (n,).
        pdos: the synchronous TPDOs of all axes, as (axis, PDO).
        times_ns: when each of ``pdos`` came last; shape (len(pdos),).
    """

    def __init__(self, axes: Sequence[AxisLayout], sync_period_s: float, stale_s: float) -> None:
        count = len(axes)
        self.columns: dict[int, IntArray] = {
            number: np.zeros(count, np.int64) for number in _OBJECTS
        }
        self._unread = np.zeros(count, np.int64)
        self.pdos = [
            (number, pdo)
            for number, axis in enumerate(axes)
            for pdo in axis.tpdos
            if pdo.transmission <= _EVENT_DRIVEN
        ]
        self.times_ns: IntArray = np.full(len(self.pdos), -1, np.int64)
        turns = np.array([pdo.transmission for _, pdo in self.pdos], np.float64)
        least_s = turns * sync_period_s * _ALLOWED_MISSES
        self.limits_ns: IntArray = (np.maximum(least_s, stale_s) * 1e9).astype(np.int64)
        self.counts: IntArray = np.zeros(count, np.int64)  # position without the encoder's wrap
        self._raw: IntArray = np.zeros(count, np.int64)

    def handler(self, axis: int, pdo: Pdo) -> Handler:
        """Receives one TPDO of one axis: raises ValueError for a frame that is too short."""
        size, unpack = pdo.layout.size, pdo.layout.unpack_from
        columns = [self.columns.get(entry.base, self._unread) for entry in pdo.entries]
        slot = self.pdos.index((axis, pdo)) if (axis, pdo) in self.pdos else None

        def receive(data: bytearray, time_ns: int) -> None:
            if len(data) < size:
                raise ValueError(f"{pdo.name} has {len(data)} bytes, {size} are mapped")
            for column, value in zip(columns, unpack(data), strict=True):
                column[axis] = value
            if slot is not None:
                self.times_ns[slot] = time_ns

        return receive

    def forget(self, axis: int) -> None:
        """The drive is configured anew: what it said before does not count."""
        for slot, (owner, _) in enumerate(self.pdos):
            if owner == axis:
                self.times_ns[slot] = -1

    def heard(self, axis: int) -> bool:
        """Every synchronous TPDO of ``axis`` has come at least once."""
        return all(
            self.times_ns[slot] >= 0 for slot, (owner, _) in enumerate(self.pdos) if owner == axis
        )

    def unwrap(self) -> None:
        """Cycle: bring ``counts`` up to date; an endless axis runs over 32 bits."""
        raw = self.columns[POSITION]
        step = raw - self._raw
        self.counts += (step + SPAN // 2) % SPAN - SPAN // 2
        self._raw += step

    def rebase(self, axis: int) -> None:
        """The drive has set its position anew: no turns are remembered."""
        self.counts[axis] = self._raw[axis] = self.columns[POSITION][axis]

    def demand(self, axis: int) -> int:
        """The drive's own position demand, without the wrap."""
        step = int(self.columns[DEMAND][axis] - self._raw[axis])
        return int(self.counts[axis]) + (step + SPAN // 2) % SPAN - SPAN // 2
