"""Last minute of the control loop at the rate of a plot, in bounded memory."""

from __future__ import annotations

import threading

import numpy as np

from robotd.api import NANOSECONDS, FloatArray, Frames
from robotd.api.features import VALUES

HISTORY_S = 60.0
RATE_HZ = 30.0  # lower where the rows would not fit into ``HISTORY_BYTES``
HISTORY_BYTES = 2 * 2**20
HISTORY_COLUMNS = 2  # before the values: time, lateness
PIECE_ROWS = 256  # copied at once, which holds the interpreter: 30 us


class PlotHistory:
    """One row per interval: time, largest lateness, values of the last period.

    ``add`` belongs to one thread; any thread may read.

    Args:
        axes: number of axes of a frame.
        rate_hz: of the control loop.

    Attributes:
        step: number of periods of an interval.
    """

    def __init__(self, axes: int, rate_hz: float) -> None:
        width = HISTORY_COLUMNS + len(VALUES) * axes
        affordable = HISTORY_BYTES // (8 * width)
        self.step = max(1, round(rate_hz / RATE_HZ), -(-round(HISTORY_S * rate_hz) // affordable))
        capacity = max(2, min(affordable, round(HISTORY_S * rate_hz) // self.step))
        self._rows: FloatArray = np.full((capacity, width), np.nan)
        self._written = 0
        self._periods, self._late_ns = 0, 0  # of the interval that has begun
        self._lock = threading.Lock()

    @property
    def nbytes(self) -> int:
        """Size of the memory."""
        return int(self._rows.nbytes)

    def add(self, frames: Frames) -> None:
        """Add the frames after those of the last call."""
        late_ns = frames["late_ns"]
        ends = np.arange(self.step - 1 - self._periods, len(frames), self.step)
        if not len(ends):
            self._periods += len(frames)
            self._late_ns = max(self._late_ns, int(late_ns.max(initial=0)))
            return
        begun = int(ends[-1]) + 1
        largest_ns = np.maximum.reduceat(late_ns[:begun], [0, *(ends[:-1] + 1)])
        largest_ns[0] = max(largest_ns[0], self._late_ns)
        rows = np.empty((len(ends), self._rows.shape[1]))
        rows[:, 0] = frames["start_ns"][ends] / NANOSECONDS
        rows[:, 1] = largest_ns / NANOSECONDS
        rows[:, HISTORY_COLUMNS:] = frames["values"][ends].reshape(len(ends), -1)
        self._periods = len(frames) - begun
        self._late_ns = int(late_ns[begun:].max(initial=0))
        self._keep(rows)

    def _keep(self, rows: FloatArray) -> None:
        capacity = len(self._rows)
        rows = rows[-capacity:]
        with self._lock:
            self._rows[(self._written + np.arange(len(rows))) % capacity] = rows
            self._written += len(rows)

    def rows(self) -> FloatArray:
        """Return a copy, oldest row first: time and lateness in seconds, then the values."""
        with self._lock:
            capacity = len(self._rows)
            count = min(self._written, capacity)
            copied = np.empty((count, self._rows.shape[1]))
            first = self._written - count
            for begin in range(0, count, PIECE_ROWS):
                indices = np.arange(begin, min(begin + PIECE_ROWS, count))
                copied[indices] = self._rows[(first + indices) % capacity]
            return copied
