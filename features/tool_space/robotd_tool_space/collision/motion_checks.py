"""Checks of motion by distances of bodies: of whole paths, and of the way to a stop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from robotd.api import BoolArray, FloatArray, InvalidArgument
from robotd.api.robots import Trajectory, distinct, reject

STEP_S = 0.005  # of a path between two checks
CHUNK_POSTURES = 400  # postures in one computation
ROUNDING_M = 1e-9


class MotionChecks(ABC):
    """Checks of motion by distances. A motion from where bodies are too close may lead away.

    Immutable; any thread.
    """

    @property
    @abstractmethod
    def margin_m(self) -> float:
        """Least distance, m."""

    @property
    @abstractmethod
    def joints(self) -> tuple[str, ...]:
        """Names of the n joints, in the order of positions."""

    @property
    @abstractmethod
    def names(self) -> tuple[tuple[str, str], ...]:
        """Names of both bodies of each of the d distances."""

    @abstractmethod
    def distances(self, positions: FloatArray) -> FloatArray:
        """Return the distances (k, d) at positions (k, n), m; negative: overlaps."""

    def check_path(
        self,
        trajectory: Trajectory,
        begin_s: float = 0.0,
        completed: Callable[[FloatArray], FloatArray] = lambda positions: positions,
    ) -> None:
        """Check a path, or what is left of it from ``begin_s`` on.

        ``completed``: makes (k, n) of the positions of the trajectory's joints.

        Raises TrajectoryRejected where two bodies come too close: with both, time and place.
        """
        duration_s = trajectory.duration_s
        begin_s = min(begin_s, duration_s)
        count = int(np.ceil((duration_s - begin_s) / STEP_S)) + 1
        times_s = np.linspace(begin_s, duration_s, max(count, 1))
        least = None
        for first in range(0, len(times_s), CHUNK_POSTURES):
            part_s = times_s[first : first + CHUNK_POSTURES]
            distances = self.distances(completed(trajectory.evaluate(part_s)[0]))
            if least is None:
                least = self._least(distances[0])
            close = distances < least
            if close.any():
                at = int(close.any(axis=1).argmax())
                time_s = float(part_s[at])
                place = f"at {time_s:.2f} s ({100.0 * time_s / duration_s:.0f} %)"
                raise reject(f"{place} {self._text(distances[at], close[at])}")

    def check_positions(self, positions: FloatArray) -> None:
        """Check a path by positions (k, n) on it, as ``check_path`` does; k at least 1.

        Raises InvalidArgument where two bodies come too close, with both and the place.
        """
        least = None
        for first in range(0, len(positions), CHUNK_POSTURES):
            distances = self.distances(positions[first : first + CHUNK_POSTURES])
            if least is None:
                least = self._least(distances[0])
            close = distances < least
            if close.any():
                at = int(close.any(axis=1).argmax())
                place = 100.0 * (first + at) / max(len(positions) - 1, 1)
                raise InvalidArgument(f"at {place:.0f} % {self._text(distances[at], close[at])}")

    def obstacle(self, positions: FloatArray, stopped: FloatArray) -> str:
        """Return what comes too close on the way from ``positions`` (n,) to ``stopped`` (n,).

        A joint whose position is not known counts as too close: it is named.
        """
        if not (known := np.isfinite(stopped)).all():
            return f"the position of {self.joints[int(known.argmin())]} is not known"
        way = np.stack([positions, 0.5 * (positions + stopped), stopped])
        distances = self.distances(way)
        close = distances[1:] < self._least(distances[0])
        if not close.any():
            return ""
        at = int(close.any(axis=1).argmax())
        return self._text(distances[1 + at], close[at])

    def _least(self, distances: FloatArray) -> FloatArray:
        """Return the least distances of a motion from ``distances`` (d,): it may lead away."""
        return np.minimum(self.margin_m, distances - ROUNDING_M)

    def _text(self, distances: FloatArray, close: BoolArray) -> str:
        number = int(np.where(close, distances, np.inf).argmin())
        first, second = self.names[number]
        distance, margin = float(distances[number]), self.margin_m
        apart, least = distinct(1e3 * max(distance, 0.0), 1e3 * margin, 2)
        how = "would touch" if distance <= 0.0 else f"would be {apart} mm apart"
        return f"{first} and {second} {how}, the least distance is {least} mm"
