"""Curves of a tool in space: lines, arcs, splines through poses, and the corner between two.

The parameter s of a curve is the time it takes at full speed of the tool, in seconds: names of such
values end in ``_s``. The times of a motion along it are those of ``timing.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from robotd.api import FloatArray, InvalidArgument
from robotd_tool_space.geometry.rotations import (
    inverse_pose,
    pose_differences,
    rotation_matrices,
)

STRAIGHT = 1e-6  # sine of the angle between the points of an arc below which they are on a line
SAME_M = 1e-6
RATE_SAMPLES = 200  # of a spline, for its highest rates
RATE_MARGIN = 1.02  # of these: between two samples they are a little higher


class ToolCurve(Protocol):
    """Poses of a tool over s."""

    @property
    def length_s(self) -> float:
        """Range of s, from 0."""
        ...

    @property
    def rates(self) -> FloatArray:
        """(2,) upper bounds of the derivatives by s: m and rad."""
        ...

    def poses(self, at_s: FloatArray) -> FloatArray:
        """Return the poses (k, 4, 4) at (k,) s."""
        ...


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
        return self.acceleration / self.velocity * self.angular_velocity

    @property
    def velocities(self) -> FloatArray:
        """(2,) m/s and rad/s."""
        return np.array([self.velocity, self.angular_velocity])

    @property
    def accelerations(self) -> FloatArray:
        """(2,) m/s² and rad/s²."""
        return np.array([self.acceleration, self.angular_acceleration])

    def scaled(self, speed: float) -> ToolSpeed:
        """Return the limits at a part of the speed, with the same acceleration."""
        return ToolSpeed(self.velocity * speed, self.angular_velocity * speed, self.acceleration)

    def time_s(self, linear: float, angular: float) -> float:
        """Return the time of a distance of m and rad at full speed."""
        return max(linear / self.velocity, angular / self.angular_velocity)


@dataclass(frozen=True, eq=False)
class LineCurve:
    """Straight line; the tool turns about one fixed axis in step with it.

    Attributes:
        start: (4, 4) first pose.
        displacement: (6,) translation and rotation vector, in the base.
    """

    start: FloatArray
    displacement: FloatArray
    length_s: float

    @classmethod
    def to(cls, start: FloatArray, end: FloatArray, speed: ToolSpeed) -> LineCurve:
        """Return the line between two poses; its length is 0 where they are the same."""
        displacement = pose_differences(start, end)
        linear, angular = np.linalg.norm(displacement[:3]), np.linalg.norm(displacement[3:])
        return cls(start, displacement, speed.time_s(float(linear), float(angular)))

    @property
    def rates(self) -> FloatArray:
        return np.linalg.norm(self.displacement.reshape(2, 3), axis=1) / self.length_s

    def poses(self, at_s: FloatArray) -> FloatArray:
        part = (at_s / self.length_s)[:, None]
        place = self.start[:3, 3] + part * self.displacement[:3]
        return _poses(place, rotation_matrices(part * self.displacement[3:]) @ self.start[:3, :3])


@dataclass(frozen=True, eq=False)
class ArcCurve:
    """Arc of a circle; the tool turns about one fixed axis in step with it.

    Attributes:
        start: (4, 4) first pose.
        radius: (3,) vector from the centre to the first position, m.
        axis: (3,) unit vector that the arc turns about.
        angle: of the arc, rad; above 0.
        turn: (3,) rotation vector of the tool on the whole arc.
    """

    start: FloatArray
    radius: FloatArray
    axis: FloatArray
    angle: float
    turn: FloatArray
    length_s: float

    @classmethod
    def through(
        cls, start: FloatArray, via: FloatArray, end: FloatArray, speed: ToolSpeed
    ) -> ArcCurve:
        """Return the arc through three positions; the orientation of ``via`` does not count.

        Raises InvalidArgument: two are at the same place, or the three are on a line.
        """
        first, second, third = start[:3, 3], via[:3, 3], end[:3, 3]
        sides = np.array([second - first, third - second, first - third])
        lengths = np.linalg.norm(sides, axis=1)
        if lengths.min() < SAME_M:
            raise InvalidArgument("an arc needs three different places: start, `via` and `to`")
        axis = np.cross(sides[0], sides[1])
        size = float(np.linalg.norm(axis))
        if size < STRAIGHT * lengths[0] * lengths[1]:
            raise InvalidArgument("start, `via` and `to` of the arc are on a straight line")
        # Of the circle through a triangle: the weights of its corners are sin 2α and so on.
        squares = np.roll(lengths**2, -1)  # opposite to the first, the second, the third
        weights = squares * (squares.sum() - 2.0 * squares)
        centre = (weights[:, None] * np.array([first, second, third])).sum(axis=0) / weights.sum()
        axis, radius = axis / size, first - centre
        to = third - centre
        angle = np.arctan2(to @ np.cross(axis, radius), to @ radius) % (2.0 * np.pi)
        return cls._of(start, radius, axis, float(angle), pose_differences(start, end)[3:], speed)

    @classmethod
    def about(
        cls, start: FloatArray, centre: FloatArray, angle: float, speed: ToolSpeed, *, turns: bool
    ) -> ArcCurve:
        """Return the arc about the z axis of ``centre`` (4, 4), by a positive or negative angle.

        ``turns``: the tool turns with the arc; otherwise it keeps its orientation.

        Raises InvalidArgument: the tool is on that axis.
        """
        axis = centre[:3, 2] * np.sign(angle)
        off = start[:3, 3] - centre[:3, 3]
        radius = off - (off @ axis) * axis
        if np.linalg.norm(radius) < SAME_M:
            raise InvalidArgument("the tool is on the axis of the arc: `centre` must be beside it")
        turn = axis * abs(angle) if turns else np.zeros(3)
        return cls._of(start, radius, axis, abs(angle), turn, speed)

    @classmethod
    def _of(
        cls,
        start: FloatArray,
        radius: FloatArray,
        axis: FloatArray,
        angle: float,
        turn: FloatArray,
        speed: ToolSpeed,
    ) -> ArcCurve:
        length_s = speed.time_s(float(np.linalg.norm(radius)) * angle, float(np.linalg.norm(turn)))
        return cls(start, radius, axis, angle, turn, length_s)

    @property
    def rates(self) -> FloatArray:
        distances = np.array([np.linalg.norm(self.radius) * self.angle, np.linalg.norm(self.turn)])
        return distances / self.length_s

    def poses(self, at_s: FloatArray) -> FloatArray:
        part = (at_s / self.length_s)[:, None]
        angle, across = part * self.angle, np.cross(self.axis, self.radius)
        displacement = (np.cos(angle) - 1.0) * self.radius + np.sin(angle) * across
        turned = rotation_matrices(part * self.turn) @ self.start[:3, :3]
        return _poses(self.start[:3, 3] + displacement, turned)


@dataclass(frozen=True, eq=False)
class SplineCurve:
    """Cubic spline through poses, with continuous curvature, as straight as it can be at its ends.

    Attributes:
        start: (4, 4) first pose.
        knots_s: (p,) s of the poses.
        points: (p, 6) translation and rotation vector from the start, in the base.
        second_derivatives: (p, 6) of ``points``, by s.
    """

    start: FloatArray
    knots_s: FloatArray
    points: FloatArray
    second_derivatives: FloatArray

    @classmethod
    def through(cls, poses: Sequence[FloatArray], speed: ToolSpeed) -> SplineCurve:
        """Return the spline; the first of the poses (4, 4) is its start.

        Raises InvalidArgument: two successive poses are the same.
        """
        lines = [LineCurve.to(*pair, speed) for pair in pairwise(poses)]
        lengths_s = np.array([line.length_s for line in lines])
        if lengths_s.min() < SAME_M / speed.velocity:
            number = int(lengths_s.argmin()) + 1
            raise InvalidArgument(f"pose {number} of the spline is the same as the one before")
        points = np.array([pose_differences(poses[0], pose) for pose in poses])
        for before, here in pairwise(points[:, 3:]):
            size = float(np.linalg.norm(here))
            if size > 0.0:  # a vector and those longer by a turn are the same orientation
                turns = np.round((before @ here / size - size) / (2.0 * np.pi))
                here[:] = here * (1.0 + 2.0 * np.pi * turns / size)
        knots_s = np.concatenate([[0.0], np.cumsum(lengths_s)])
        raw = cls(poses[0], knots_s, points, _natural_second_derivatives(knots_s, points))
        # At its fastest place the tool is at full speed where s passes as time does.
        factor = float((raw.rates / speed.velocities).max())
        return cls(poses[0], factor * knots_s, points, raw.second_derivatives / factor**2)

    @property
    def length_s(self) -> float:
        return float(self.knots_s[-1])

    @cached_property
    def rates(self) -> FloatArray:
        poses = self.poses(np.linspace(0.0, self.length_s, RATE_SAMPLES + 1))
        steps = pose_differences(poses[:-1], poses[1:]).reshape(-1, 2, 3)
        fastest: FloatArray = np.linalg.norm(steps, axis=2).max(axis=0)
        return RATE_MARGIN * RATE_SAMPLES / self.length_s * fastest

    def poses(self, at_s: FloatArray) -> FloatArray:
        knots = self.knots_s
        index = np.clip(np.searchsorted(knots, at_s, "right") - 1, 0, len(knots) - 2)
        width = (knots[index + 1] - knots[index])[:, None]
        passed = (at_s - knots[index])[:, None] / width
        before = 1.0 - passed
        displacement = before * self.points[index] + passed * self.points[index + 1]
        displacement += (
            width**2
            / 6.0
            * (
                (before**3 - before) * self.second_derivatives[index]
                + (passed**3 - passed) * self.second_derivatives[index + 1]
            )
        )
        turned = rotation_matrices(displacement[:, 3:]) @ self.start[:3, :3]
        return _poses(self.start[:3, 3] + displacement[:, :3], turned)


def _natural_second_derivatives(knots_s: FloatArray, points: FloatArray) -> FloatArray:
    """Return the second derivatives (p, 6) of the cubic spline that has none at its ends."""
    count = len(knots_s)
    second_derivatives = np.zeros_like(points)
    if count > 2:
        widths = np.diff(knots_s)
        matrix = np.diag(2.0 * (widths[:-1] + widths[1:]))
        matrix += np.diag(widths[1:-1], 1) + np.diag(widths[1:-1], -1)
        slopes = np.diff(points, axis=0) / widths[:, None]
        second_derivatives[1:-1] = np.linalg.solve(matrix, 6.0 * np.diff(slopes, axis=0))
    return second_derivatives


@dataclass(frozen=True, eq=False)
class CornerCurve:
    """Corner between two curves: the end of the first one fades while the second one begins.

    The rest of the first curve is passed with decreasing speed while the second one is passed with
    increasing speed: between two lines a parabola.

    Attributes:
        reach_s: of the end of the first curve, and of the start of the second one.
    """

    before: ToolCurve
    after: ToolCurve
    reach_s: float

    @property
    def length_s(self) -> float:
        return 2.0 * self.reach_s

    @property
    def rates(self) -> FloatArray:
        return np.maximum(self.before.rates, self.after.rates)

    def poses(self, at_s: FloatArray) -> FloatArray:
        first_s, second_s = corner_places(at_s, self.before.length_s, self.reach_s)
        first, second = self.before.poses(first_s), self.after.poses(second_s)
        (corner,) = self.after.poses(np.zeros(1))
        back = inverse_pose(corner)[:3, :3]
        place = first[:, :3, 3] + second[:, :3, 3] - corner[:3, 3]
        return _poses(place, second[:, :3, :3] @ back @ first[:, :3, :3])


def corner_places(
    at_s: FloatArray, length_s: float, reach_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return where a corner is on the curve before it, of ``length_s``, and on the one after it."""
    part = at_s / (2.0 * reach_s)
    return length_s - reach_s * (1.0 - part) ** 2, reach_s * part**2


def _poses(places: FloatArray, turned: FloatArray) -> FloatArray:
    result = np.empty((len(places), 4, 4))
    result[:, :3, 3], result[:, :3, :3] = places, turned
    result[:, 3] = 0.0, 0.0, 0.0, 1.0
    return result
