"""Positions of joints over time, as files of other programs have them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robotd.api import FloatArray, InvalidArgument
from robotd.api.robots import JointLimits
from robotd_teach.joint_groups import beyond_limits
from robotd_teach.path_recorder import GAP_S, MAX_S, MOVED


class FileMotion(NamedTuple):
    """Motion of some joints in a file.

    Attributes:
        source: the file, for errors.
        times_s: (k,) of the rows, increasing, in s from the start of the file.
        positions: (k, n), rad or m.
    """

    source: str
    times_s: FloatArray
    positions: FloatArray

    def between(self, begin_s: float, end_s: float) -> FileMotion:
        """Return the rows of a part of the time."""
        chosen = (self.times_s >= begin_s) & (self.times_s <= end_s)
        return self._replace(times_s=self.times_s[chosen], positions=self.positions[chosen])

    def require_path(self, limits: JointLimits) -> None:
        """Raise InvalidArgument where the joints of ``limits`` cannot follow it as a path."""
        times_s, rows, source = self.times_s, self.positions, self.source
        if len(times_s) < 2:
            raise InvalidArgument(f"{source}: no positions in this part of its time")
        if (length_s := times_s[-1] - times_s[0]) > MAX_S:
            text = f"it lasts {length_s:.0f} s, a path at most {MAX_S:g} s"
            raise InvalidArgument(f"{source}: {text}: choose a part by its start and end")
        moved = np.array([MOVED[unit] for unit in limits.units])
        gaps = (np.diff(times_s) > GAP_S) & (np.abs(np.diff(rows, axis=0)) > moved).any(axis=1)
        if gaps.any():
            first = int(gaps.argmax())
            gap_s = times_s[first + 1] - times_s[first]
            text = f"the joints moved during {gap_s:.1f} s without positions, at"
            raise InvalidArgument(f"{source}: {text} {times_s[first]:.2f} s")
        if problem := beyond_limits(limits, rows):
            raise InvalidArgument(f"{source}: {problem}")
