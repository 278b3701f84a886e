"""Pose of the axes at the start of a run, to which every check returns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotd.arrays import FloatArray
from robotd.device.process_image import ProcessImage
from robotd.errors import InvalidArgument
from robotd.motion.limits import AxisLimits

TRAVEL_RAD = 0.3  # the farthest that a check moves an axis; m for a linear one
MAX_EXCURSION_RAD = 0.45  # at which a run ends, by default: checks that stop a move overshoot
START_RAD = 2e-3  # an axis that is so near to its start pose is there
ROOM = 0.8  # share of the way to a position limit that is used where neither side has the travel


class StartPose:
    """First known position of each axis, and how far the checks went from it.

    Args:
        max_excursion: rad or m from the start pose, at which a run on hardware ends; None: 0.45.

    Raises InvalidArgument: it is not more than the way of one check.

    Attributes:
        max_excursion: as above.
        position: (n_axes,) rad or m; None: not known yet.
        left: (n_axes,) where the last connection has left the axes; None: not known.
        farthest: (n_axes,) largest distance from ``position`` that was measured.
        exceeded: text of the first axis beyond ``max_excursion``; "" without one.
        counts: distances count; not in a check that changes what a position means.
    """

    def __init__(self, max_excursion: float | None = None) -> None:
        self.max_excursion = MAX_EXCURSION_RAD if max_excursion is None else max_excursion
        if not self.max_excursion > TRAVEL_RAD:
            raise InvalidArgument(
                f"--max-excursion is {max_excursion}, must be more than {TRAVEL_RAD:g} rad, the way"
                " of one check"
            )
        self.position: FloatArray | None = None
        self.left: FloatArray | None = None
        self.farthest: FloatArray = np.zeros(0)
        self.exceeded = ""
        self.counts = True
        self._travel: FloatArray = np.zeros(0)

    def begin(
        self, position: FloatArray, limits: Sequence[AxisLimits], names: Sequence[str]
    ) -> None:
        """Take ``position`` as the start pose; later calls have no effect."""
        if self.position is None:
            self._names, self._units = names, [limit.unit for limit in limits]
            self.farthest = np.zeros(len(position))
            self._travel = np.array(
                [
                    _way(axis, float(position[axis]), limits[axis], len(limits))
                    for axis in range(len(limits))
                ]
            )
            self.position = position.copy()

    def is_start(self, position: FloatArray) -> bool:
        """Return True where ``position`` (n_axes,) is the start pose."""
        return self.position is not None and self.away(position) <= START_RAD

    def away(self, position: FloatArray) -> float:
        """Return the largest distance of an axis from the start pose, once it is known."""
        assert self.position is not None
        return float(np.abs(position - self.position).max())

    def travel(self, share: float) -> FloatArray:
        """Return (n_axes,) signed distances, all different; always to the same side."""
        return self._travel * share

    def track(self, image: ProcessImage) -> None:
        """Note how far the axes are from the start pose. Control loop."""
        if self.position is None or not self.counts:
            return
        away = np.abs(image.position - self.position)
        np.fmax(self.farthest, away, out=self.farthest)
        axis = int(np.nan_to_num(away).argmax())
        if away[axis] > self.max_excursion and not self.exceeded:
            unit = self._units[axis]
            self.exceeded = (
                f"{self._names[axis]} is {away[axis]:.3f} {unit} from its start pose;"
                f" --max-excursion is {self.max_excursion:g} {unit}"
            )

    def summary(self) -> str:
        """Return which axis went farthest; "" while no start pose is known."""
        if self.position is None:
            return ""
        axis = int(self.farthest.argmax())
        return (
            f"farthest from the start pose: {self._names[axis]}, {self.farthest[axis]:.3f}"
            f" {self._units[axis]} (--max-excursion {self.max_excursion:g})"
        )


def _way(axis: int, start: float, limits: AxisLimits, count: int) -> float:
    """Return the signed travel of an axis: sides alternate where both have room for it."""
    size = TRAVEL_RAD * float(np.linspace(1.0, 0.5, count)[axis])
    up, down = limits.upper - start, start - limits.lower
    sign = -1.0 if axis % 2 else 1.0
    if (up if sign > 0.0 else down) <= size:
        sign = 1.0 if up >= down else -1.0
    return sign * min(size, ROOM * max(up, down, 0.0))
