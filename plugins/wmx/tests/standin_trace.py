"""Axes in every cycle of the stand-in's engine, written with ``WMX_STANDIN_TRACE``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

AXES, CYCLE_S = 6, 0.001
ROW = np.dtype([("time_ns", "<i8"), ("command", "<f8", AXES), ("position", "<f8", AXES)])


@dataclass(frozen=True)
class Trace:
    """Record of one engine, complete once the engine has ended."""

    path: Path

    def velocities(self, since_ns: int = 0, axis: int = 0) -> np.ndarray:
        """(k,) commanded velocities of the cycles after ``since_ns``, rad/s."""
        rows = np.fromfile(self.path, ROW)
        velocities = np.diff(rows["command"][:, axis]) / CYCLE_S
        later: np.ndarray = velocities[rows["time_ns"][1:] > since_ns]
        return later
