"""Paths of a tool in space: straight lines through poses, with rounded corners where asked.

The parameter of a path is the time it takes at full speed of the tool: the translation in m divided
by the speed in m/s, or the rotation in rad divided by the angular speed, whichever is longer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from robotd.api import FloatArray
from robotd_tool_space.rotations import pose_differences, rotation_matrices

NO_LENGTH_S = 1e-6  # a piece below it is left out


@dataclass(frozen=True, eq=False)
class Piece:
    """Straight piece, or a corner between two.

    A corner is a parabola: translation and rotation go on with the velocity of the first line,
    which decreases linearly to 0 while that of the second one increases from 0.

    Attributes:
        start: (4, 4) first pose.
        way: (6,) translation and rotation vector, in the base, of a straight piece; of a corner
            those that remain of the first line up to where the lines meet.
        onward: (6,) of a corner: the part of the second line; zeros for a straight piece.
        length_s: s at full speed of the tool.
    """

    start: FloatArray
    way: FloatArray
    onward: FloatArray
    length_s: float
    is_corner: bool = False

    def poses(self, at_s: FloatArray) -> FloatArray:
        """Return the poses (k, 4, 4) at (k,) s from the start of the piece."""
        part = at_s / self.length_s
        first, second = part, np.zeros_like(part)
        if self.is_corner:
            first, second = part * (2.0 - part), part * part
        result = np.tile(np.eye(4), (len(at_s), 1, 1))
        result[:, :3, 3] = (
            self.start[:3, 3] + first[:, None] * self.way[:3] + second[:, None] * self.onward[:3]
        )
        turned = rotation_matrices(first[:, None] * self.way[3:])
        turned = rotation_matrices(second[:, None] * self.onward[3:]) @ turned
        result[:, :3, :3] = turned @ self.start[:3, :3]
        return result


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Path of a tool.

    Attributes:
        pieces: one after the other.
        stops: pieces behind which the tool stands still, by index; the last one is not named.
    """

    pieces: tuple[Piece, ...]
    stops: frozenset[int] = frozenset()

    @classmethod
    def through(
        cls,
        poses: Sequence[FloatArray],
        speed_m_s: float,
        speed_rad_s: float,
        blend_m: float = 0.0,
    ) -> ToolPath:
        """Return the path of straight lines through ``poses``, of which the first is the start.

        Args:
            poses: (4, 4) each, in the base.
            blend_m: distance from an inner pose at which the path leaves the line; at most half of
                the shorter line. 0: the tool stops at each pose.
        """
        starts: list[FloatArray] = []
        ways: list[FloatArray] = []
        lengths: list[float] = []
        for start, end in pairwise(poses):
            way = pose_differences(start, end)
            linear, angular = np.linalg.norm(way[:3]), np.linalg.norm(way[3:])
            length_s = float(max(linear / speed_m_s, angular / speed_rad_s))
            if length_s > NO_LENGTH_S:
                starts.append(start)
                ways.append(way)
                lengths.append(length_s)
        corners = [0.0, *map(_corner_s, pairwise(ways), pairwise(lengths), [blend_m] * len(ways))]
        return cls(*_pieces(starts, ways, lengths, [*corners, 0.0]))

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
        edges = self.edges_s
        index = np.clip(np.searchsorted(edges, at_s, "right") - 1, 0, len(self.pieces) - 1)
        result = np.empty((len(at_s), 4, 4))
        for number in np.unique(index).tolist():
            inside = index == number
            result[inside] = self.pieces[number].poses(at_s[inside] - edges[number])
        return result


def _corner_s(
    ways: tuple[FloatArray, FloatArray], lengths: tuple[float, float], blend_m: float
) -> float:
    """Return the time between a corner's ends and its pose; 0: a stop."""
    longest = 0.5 * min(lengths)
    for way, length_s in zip(ways, lengths, strict=True):
        linear = float(np.linalg.norm(way[:3]))
        if linear * longest > blend_m * length_s:
            longest = blend_m * length_s / linear
    return longest if longest > NO_LENGTH_S and blend_m > 0.0 else 0.0


def _pieces(
    starts: Sequence[FloatArray],
    ways: Sequence[FloatArray],
    lengths: Sequence[float],
    corners: Sequence[float],
) -> tuple[tuple[Piece, ...], frozenset[int]]:
    pieces: list[Piece] = []
    stops = set()
    still = np.zeros(6)
    for number, (start, way, length_s) in enumerate(zip(starts, ways, lengths, strict=True)):
        line = Piece(start, way, still, length_s)
        before, behind = corners[number], corners[number + 1]
        straight_s = length_s - before - behind
        if straight_s > NO_LENGTH_S:
            (first,) = line.poses(np.array([before]))
            pieces.append(Piece(first, way * straight_s / length_s, still, straight_s))
        if number == len(starts) - 1:
            break
        if behind == 0.0:
            stops.add(len(pieces) - 1)
            continue
        (first,) = line.poses(np.array([length_s - behind]))
        onward = ways[number + 1] * behind / lengths[number + 1]
        pieces.append(Piece(first, way * behind / length_s, onward, 2.0 * behind, is_corner=True))
    return tuple(pieces), frozenset(stops)
