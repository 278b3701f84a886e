"""Live values of the page, sampled from the frames of the control loop."""

from __future__ import annotations

import math
import struct

import numpy as np

from robotd.api import NANOSECONDS, FloatArray
from robotd.api.features import VALUES, Tap
from robotd.api.robots import JointGroup, TrajectoryExecution
from robotd_page.plot_history import HISTORY_COLUMNS, PlotHistory

RATE_HZ = 30.0
HEADER = ("time_s", "late_s", "closed", "x", "y", "heading")


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
        """Return samples of the last minute, one behind the other."""
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
