"""Trajectories as point-time cubic splines on the engine.

The engine starts at the present command, at time 0, both implicitly, passes every point and
ends at rest. It drops points closer than 1e-6 user units to the one before and refuses times
less than 1e-3 ms apart; both would change or lose the path, so that neither is ever sent.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotd.api import FloatArray, OperationError
from robotd_wmx import _native
from robotd_wmx._native import CallError
from robotd_wmx.connection import WmxConnection
from robotd_wmx.errors import name_of, translate, translated

SHORTEST_MS = 1e-3  # between two points
CLOSEST_UNITS = 1e-6  # closer points are dropped by the engine
NUDGE_UNITS = 2e-6  # well below an encoder count of a geared joint, and enough not to be dropped


class Splines:
    """One spline channel of the engine. Worker threads, one at a time.

    Its buffer is allocated once, at start-up, for the longest trajectory: the manual warns of
    fragmentation. The engine keeps it over the death of a process.
    """

    def __init__(self, connection: WmxConnection) -> None:
        self._connection = connection
        self._channel = connection.options.spline_channel

    @property
    def max_points(self) -> int:
        """Points of a trajectory that the buffer takes, its start included."""
        return self._connection.robot.trajectory.max_points + 1

    def allocate(self) -> None:
        """Make the buffer, unless a large one is there. Raises OperationError."""
        device, points = self._connection.command, self.max_points
        what = f"spline buffer of {points} points on channel {self._channel}"
        try:
            device.create_spline_buffer(self._channel, points)
        except CallError as error:
            if name_of(error) != "ChannelBufferMemoryAlreadyAllocated":
                raise translate(error, what) from error
            with translated(what):
                present = device.spline_buffer_points(self._channel)
                if present >= points:
                    return
                if others := self._connection.others():
                    raise OperationError(
                        f"{what}: another program ({', '.join(others)}) has one of {present} points"
                        " there; give this robot a channel of its own (backends.wmx.spline_channel)"
                    ) from error
                device.free_spline_buffer(self._channel)  # left by a program that has ended
                device.create_spline_buffer(self._channel, points)

    def start(self, axes: Sequence[int], times_s: FloatArray, positions: FloatArray) -> None:
        """See ``AxisDriver.follow``. Raises OperationError naming the figure and the limit."""
        check(axes, times_s)
        times_ms, points = engine_points(times_s, positions * self._connection.scaling.units[axes])
        with translated(f"trajectory of {len(times_ms)} points"):
            self._connection.command.start_spline(self._channel, list(axes), times_ms, points)


def check(axes: Sequence[int], times_s: FloatArray) -> None:
    """Raise OperationError for what the engine cannot take."""
    if len(axes) > _native.MAX_SPLINE_AXES:
        raise OperationError(
            f"trajectory of {len(axes)} axes: the engine's splines have at most"
            f" {_native.MAX_SPLINE_AXES}"
        )
    shortest = int(np.argmin(np.diff(times_s)))
    gap_ms = float(times_s[shortest + 1] - times_s[shortest]) * 1000.0
    if gap_ms < SHORTEST_MS:
        raise OperationError(
            f"trajectory: {gap_ms:.2g} ms between the points at {times_s[shortest]:.6f} s and"
            f" after it, the engine needs {SHORTEST_MS:g} ms"
        )


def engine_points(times_s: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return times in ms and points in user units, without the start.

    One segment becomes two on the same cubic (the engine wants two points besides the start),
    and a point on top of the one before is nudged aside so that the pause between them stays.
    """
    if len(times_s) == 2:
        times_s = np.linspace(times_s[0], times_s[1], 3)
        points = np.vstack([points[0], (points[0] + points[1]) / 2.0, points[1]])
    points = points.copy()
    for row in range(1, len(points)):
        if np.linalg.norm(points[row] - points[row - 1]) < CLOSEST_UNITS:
            points[row, 0] += NUDGE_UNITS
    return np.ascontiguousarray(times_s[1:] * 1000.0), np.ascontiguousarray(points[1:])
