"""Distances of two arms on one base from each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robotd.api import FloatArray, IntArray
from robotd_tool_space.collision.bodies import Bodies
from robotd_tool_space.collision.collisions import Collisions
from robotd_tool_space.collision.motion_checks import MotionChecks


@dataclass(frozen=True, eq=False)
class BetweenArms(MotionChecks):
    """Distances of all that one arm moves from all that another moves, with tools and loads.

    Both are in the frame of one base. Positions are those of the first arm, then of the second.
    What does not move is a body of each arm's own ``Collisions``.
    """

    first: Collisions
    second: Collisions

    @property
    def margin_m(self) -> float:
        return self.first.margin_m

    @property
    def joints(self) -> tuple[str, ...]:
        return self.first.joints + self.second.joints

    @cached_property
    def names(self) -> tuple[tuple[str, str], ...]:
        links = self._bodies.links
        return tuple((links[first], links[second]) for first, second in self._pairs)

    def distances(self, positions: FloatArray) -> FloatArray:
        """Return the distances (k, d) of ``names`` at positions (k, n), m; see ``Bodies``."""
        count = len(self.first.joints)
        one, other = self._moving
        places = np.concatenate(
            [
                one.places(self.first.chain, positions[:, :count]),
                other.places(self.second.chain, positions[:, count:]),
            ],
            axis=1,
        )
        bodies = self._bodies
        segments = bodies.placed_segments(places)
        return bodies.distances(places, segments, self._pairs, self.margin_m)

    @cached_property
    def _moving(self) -> tuple[Bodies, Bodies]:
        return self.first.bodies.moving, self.second.bodies.moving

    @cached_property
    def _bodies(self) -> Bodies:
        one, other = self._moving
        return one.with_bodies(other.each())

    @cached_property
    def _pairs(self) -> IntArray:
        """(d, 2) each body of the first arm with each of the second."""
        one, other = self._moving
        count, links = len(one.links), self._bodies.links
        leaves_out = self.first.settings.leaves_out
        pairs = [
            (first, second)
            for first in range(count)
            for second in range(count, count + len(other.links))
            if not leaves_out(links[first], links[second])
        ]
        return np.array(pairs, int).reshape(-1, 2)
