"""Paths of a tool in space: curves, one after the other, with rounded corners where asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from robotd.api import FloatArray
from robotd_tool_space.paths.tool_curves import CornerCurve, ToolCurve

NO_LENGTH_S = 1e-6  # a piece below it is left out


@dataclass(frozen=True)
class Blend:
    """Distance from the pose between two curves within which the path leaves them; 0: it stops.

    Attributes:
        linear: m.
        angular: rad.
    """

    linear: float = 0.0
    angular: float = 0.0

    def reach_s(self, before: ToolCurve, after: ToolCurve) -> float:
        """Return the part of each of two curves that their corner takes: at most half of it."""
        bounds = np.array([self.linear, self.angular])
        with np.errstate(divide="ignore", invalid="ignore"):
            reaches = [np.nanmin(bounds / curve.rates) for curve in (before, after)]
        half_s = 0.5 * min(before.length_s, after.length_s)
        reach_s = float(min(*reaches, half_s))
        return reach_s if reach_s > NO_LENGTH_S else 0.0


@dataclass(frozen=True, eq=False)
class Piece:
    """Part of a curve: ``length_s`` from ``begin_s`` on."""

    curve: ToolCurve
    begin_s: float
    length_s: float

    def poses(self, at_s: FloatArray) -> FloatArray:
        """Return the poses (k, 4, 4) at (k,) s from the start of the piece."""
        return self.curve.poses(self.begin_s + at_s)


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Path of a tool; its parameter s is the time at full speed.

    Attributes:
        pieces: one after the other.
        stops: pieces after which the tool is at rest, by index; the last one is not named.
        ends_s: s at the end of each curve: in the middle of its corner.
    """

    pieces: tuple[Piece, ...]
    stops: frozenset[int] = frozenset()
    ends_s: tuple[float, ...] = ()

    @classmethod
    def of(cls, curves: Sequence[ToolCurve], blends: Sequence[Blend]) -> ToolPath:
        """Return the path along curves, each of which begins where the one before ends.

        ``blends``: between each two curves.
        """
        reaches = [
            blend.reach_s(*pair) for blend, pair in zip(blends, pairwise(curves), strict=True)
        ]
        pieces: list[Piece] = []
        stops, ends_s, passed_s = set(), [], 0.0
        for number, curve in enumerate(curves):
            before_s = reaches[number - 1] if number else 0.0
            behind_s = reaches[number] if number < len(reaches) else 0.0
            inner_s = curve.length_s - before_s - behind_s
            if inner_s > NO_LENGTH_S:
                pieces.append(Piece(curve, before_s, inner_s))
            passed_s += curve.length_s
            ends_s.append(passed_s)
            if number < len(reaches) and behind_s == 0.0:
                stops.add(len(pieces) - 1)
            elif behind_s > 0.0:
                corner = CornerCurve(curve, curves[number + 1], behind_s)
                pieces.append(Piece(corner, 0.0, corner.length_s))
        return cls(tuple(pieces), frozenset(stops), tuple(ends_s))

    @property
    def length_s(self) -> float:
        """Duration at full speed of the tool; 0: the tool is there already."""
        return sum(piece.length_s for piece in self.pieces)

    @cached_property
    def edges_s(self) -> FloatArray:
        """(pieces + 1,) parameter at the ends of the pieces."""
        return np.cumsum([0.0, *(piece.length_s for piece in self.pieces)])

    def poses(self, at_s: FloatArray) -> FloatArray:
        """Return the poses (k, 4, 4) at parameters (k,) within the path."""
        if len(self.pieces) == 1:
            return self.pieces[0].poses(at_s)
        edges = self.edges_s
        index = np.clip(np.searchsorted(edges, at_s, "right") - 1, 0, len(self.pieces) - 1)
        result = np.empty((len(at_s), 4, 4))
        for number in np.unique(index).tolist():
            inside = index == number
            result[inside] = self.pieces[number].poses(at_s[inside] - edges[number])
        return result
