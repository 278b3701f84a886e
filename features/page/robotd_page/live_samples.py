"""Live values of the page, and those of the last minute, from the frames of the control loop."""

from __future__ import annotations

import math
import struct
import threading

import numpy as np

from robotd.api import NANOSECONDS, FloatArray, Frames
from robotd.api.features import VALUES, Tap
from robotd.api.robots import JointGroup, TrajectoryExecution

RATE_HZ = 30.0  # of the history lower where the rows would not fit into ``HISTORY_BYTES``
HEADER = ("time_s", "late_s", "closed", "x", "y", "heading")
HISTORY_S = 60.0
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


class LiveSamples:
    """Samples of a robot for its viewers, and those of its last minute. One thread.

    A sample is a row of float64, little-endian: ``HEADER``, the time of the running goal of each
    joint group on its path, then the rows of ``ProcessImage.values``, each with one number for each
    axis. ``late_s`` is the largest lateness of the control loop since the sample before; unknown
    values are NaN.

    Args:
        tap: source of the frames, not started; its thread keeps the history.
    """

    def __init__(self, tap: Tap) -> None:
        self._tap, self._robot = tap, tap.robot
        self._cursor = 0
        self._values = len(HEADER) + len(tap.robot.groups)  # column of the first value
        self.width = self._values + len(VALUES) * tap.frames.axes
        self._head = struct.Struct(f"<{self._values}d")
        self._past = PlotHistory(tap.frames.axes, tap.robot.descriptor.cycle.rate_hz)
        self._past_cursor = 0
        self._keep()  # what the tap holds already
        tap.add_reader(self._keep)

    def restart(self) -> None:
        """Skip the frames up to now."""
        self._cursor = self._tap.frames.written

    def sample(self) -> bytes | None:
        """Return the newest sample; None without a new frame."""
        newest = self._tap.frames.newest(self._cursor)
        if newest is None:
            return None
        self._cursor = newest.cursor
        head = self._head.pack(
            newest.start_ns / NANOSECONDS,
            newest.late_ns / NANOSECONDS,
            self._finger_position(),
            *self._pose(),
            *map(_goal_s, self._robot.groups.values()),
        )
        return head + newest.values

    def history(self) -> bytes:
        """Return samples of the last minute, one after the other."""
        past = self._past.rows()
        rows: FloatArray = np.full((len(past), self.width), np.nan)
        rows[:, :HISTORY_COLUMNS] = past[:, :HISTORY_COLUMNS]  # the first two of ``HEADER``
        rows[:, self._values :] = past[:, HISTORY_COLUMNS:]
        return rows.astype("<f8", copy=False).tobytes()

    def _keep(self) -> None:
        """Add the newest frames to the history. Thread of the tap."""
        frames, self._past_cursor, _ = self._tap.frames.since(self._past_cursor)
        self._past.add(frames)

    def _finger_position(self) -> float:
        """Return how far the fingers are closed, 0 to 1; NaN without a gripper."""
        gripper = self._robot.gripper
        return math.nan if gripper is None else gripper.closed

    def _pose(self) -> tuple[float, float, float]:
        base = self._robot.base
        return (math.nan,) * 3 if base is None else base.pose


def _goal_s(group: JointGroup) -> float:
    """Return the time of the group's goal on its path; NaN without one."""
    source = group.motion.running
    return source.progress().time_s if isinstance(source, TrajectoryExecution) else math.nan
