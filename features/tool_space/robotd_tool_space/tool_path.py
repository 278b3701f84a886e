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


@dataclass(frozen=True)
class ToolSpeed:
    """Limits of the motion of a tool, positive.

    Attributes:
        velocity: m/s.
        angular_velocity: rad/s.
        acceleration: m/s²; the angular one is in the same ratio to the angular velocity.
    """

    velocity: float
    angular_velocity: float
    acceleration: float

    @property
    def angular_acceleration(self) -> float:
        """rad/s²."""
        return self.acceleration_s * self.angular_velocity

    @property
    def acceleration_s(self) -> float:
        """Limit of d²s/dt² of a path whose parameter is the time at full speed, 1/s."""
        return self.acceleration / self.velocity

    def scaled(self, speed: float) -> ToolSpeed:
        """Return the limits at a part of the speed, with the same acceleration."""
        return ToolSpeed(self.velocity * speed, self.angular_velocity * speed, self.acceleration)


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

    @property
    def bend(self) -> tuple[float, float]:
        """Upper bounds of the second derivatives by s, m and rad; 0 for a straight piece.

        Those of rotation have a part of each line for itself, and one of both together.
        """
        if not self.is_corner:
            return 0.0, 0.0
        turned = np.linalg.norm(self.way[3:]) * np.linalg.norm(self.onward[3:])
        change = 2.0 * (self.onward - self.way) / self.length_s**2
        together = 3.0 * turned / self.length_s**2
        return float(np.linalg.norm(change[:3])), float(np.linalg.norm(change[3:]) + together)


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
        speed: ToolSpeed,
        blend_m: float = 0.0,
    ) -> ToolPath:
        """Return the path of straight lines through ``poses``, of which the first is the start.

        Args:
            poses: (4, 4) each, in the base.
            speed: full speed of the tool.
            blend_m: distance from an inner pose at which the path leaves the line; at most half of
                the shorter line. A line that turns more than it translates is left by the angle
                that the tool turns through, at full speed, in the time of this distance. 0: the
                tool stops at each pose.
        """
        starts: list[FloatArray] = []
        ways: list[FloatArray] = []
        lengths: list[float] = []
        for start, end in pairwise(poses):
            way = pose_differences(start, end)
            linear, angular = np.linalg.norm(way[:3]), np.linalg.norm(way[3:])
            length_s = float(max(linear / speed.velocity, angular / speed.angular_velocity))
            if length_s > NO_LENGTH_S:
                starts.append(start)
                ways.append(way)
                lengths.append(length_s)
        blend_s = blend_m / speed.velocity
        corners = [min(0.5 * min(pair), blend_s) for pair in pairwise(lengths)]
        corners = [corner_s if corner_s > NO_LENGTH_S else 0.0 for corner_s in corners]
        return cls(*_pieces(starts, ways, lengths, [0.0, *corners, 0.0]))

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
