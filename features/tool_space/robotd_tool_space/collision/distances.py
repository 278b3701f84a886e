"""Distances of bodies from each other, from planes and from boxes.

A body here is all points within a radius of a line segment, or the sum of a box, a disc and a
ball, see ``bodies``; the first holds the second. Functions of "..." take any number of leading
dimensions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robotd.api import FloatArray

PARALLEL = 1e-12
BISECTIONS = 10  # of a segment, to its point that is nearest to a box
INSIDE_M = 0.005  # from a box; what reaches into it is not found farther outside
SMALLEST = 1e-12  # m, of a way that has a direction


class Shapes(NamedTuple):
    """Placed bodies, sums of a box, a disc and a ball.

    Attributes:
        middles: (..., 3) m.
        axes: (..., 3, 3) whose columns are those of the box; the disc is normal to the third.
        halves, discs, balls: (..., 3), (...) and (...), m.
    """

    middles: FloatArray
    axes: FloatArray
    halves: FloatArray
    discs: FloatArray
    balls: FloatArray

    @property
    def each(self) -> Shapes:
        """These with one more dimension (..., 1), for several directions each."""
        return Shapes(
            self.middles[..., None, :],
            self.axes[..., None, :, :],
            self.halves[..., None, :],
            self.discs[..., None],
            self.balls[..., None],
        )

    def reach(self, directions: FloatArray) -> FloatArray:
        """Return how far (...) they reach from their middles along ``directions`` (..., 3), m."""
        own = (directions[..., None, :] @ self.axes)[..., 0, :]
        box = (np.abs(own) * self.halves).sum(axis=-1)
        return box + self.discs * np.hypot(own[..., 0], own[..., 1]) + self.balls


def segment_ways(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the shortest ways (..., 3) from segments (..., 2, 3) to others, m.

    The nearest points of the two lines are clamped to the segments, one after the other: Ericson,
    *Real-Time Collision Detection*, 5.1.9.
    """
    start, other = first[..., 0, :], second[..., 0, :]
    along, across = first[..., 1, :] - start, second[..., 1, :] - other
    between = start - other
    a, e = _dot(along, along), _dot(across, across)
    b, c, f = _dot(along, across), _dot(along, between), _dot(across, between)
    a, e = np.maximum(a, PARALLEL), np.maximum(e, PARALLEL)  # a point has any place on itself
    determinant = a * e - b * b
    s = np.where(
        determinant > PARALLEL,
        np.clip((b * f - c * e) / np.maximum(determinant, PARALLEL), 0.0, 1.0),
        0.0,
    )
    t = (b * s + f) / e
    s = np.where((t < 0.0) | (e <= PARALLEL), -c / a, np.where(t > 1.0, (b - c) / a, s))
    s, t = np.clip(s, 0.0, 1.0), np.clip(t, 0.0, 1.0)
    ways: FloatArray = t[..., None] * across - s[..., None] * along - between
    return ways


def widest_gaps(first: Shapes, second: Shapes, ways: FloatArray) -> FloatArray:
    """Return distances (m,) between two bodies each, never more than the true ones, m.

    Two convex bodies are as far apart as along the direction in which their gap is widest. It is
    looked for along ``ways`` (m, 3) and the axes of both. Negative: they overlap, by less along
    each direction that was tried.
    """
    between = second.middles - first.middles
    length = np.maximum(np.linalg.norm(ways, axis=-1, keepdims=True), SMALLEST)
    axes = np.concatenate([(ways / length)[..., None], first.axes, second.axes], axis=-1)
    directions = np.swapaxes(axes, -1, -2)
    gaps = np.abs((between[:, None] @ axes)[:, 0])
    gaps -= first.each.reach(directions) + second.each.reach(directions)
    widest: FloatArray = gaps.max(axis=-1)
    return widest


def plane_distances(bodies: Shapes, normals: FloatArray, offsets: FloatArray) -> FloatArray:
    """Return the distances (..., c, w) of bodies (..., c) from planes, m.

    Negative beyond a plane: ``normals`` (w, 3) are of length 1 and point to where the arm may be,
    ``offsets`` (w,) are the distances of the planes from the origin along them.
    """
    nearest: FloatArray = bodies.middles @ normals.T - offsets - bodies.each.reach(normals)
    return nearest


def box_distances(segments: FloatArray, poses: FloatArray, halves: FloatArray) -> FloatArray:
    """Return the distances (..., c, w) of segments (..., c, 2, 3) from boxes, m.

    Negative for one that reaches into a box: how far its deepest point is from the nearest face.
    The distance of a point outside is convex along a line: its slope is bisected.

    Args:
        segments: in the base.
        poses: (w, 4, 4) of the boxes' middles.
        halves: (w, 3) half of their sizes.
    """
    ends = segments[..., :, None, :, :] - poses[:, None, :3, 3]
    ends = ends @ poses[:, :3, :3]  # in the axes of each box
    start, way = ends[..., 0, :], ends[..., 1, :] - ends[..., 0, :]
    low, high = np.zeros(start.shape[:-1]), np.ones(start.shape[:-1])
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        falls = _dot(_outside(start + middle[..., None] * way, halves), way) < 0.0
        low, high = np.where(falls, middle, low), np.where(falls, high, middle)
    outside = np.linalg.norm(_outside(start + high[..., None] * way, halves), axis=-1)
    if (outside > INSIDE_M).all():
        return outside
    return outside + np.minimum(_beyond_faces(start, way, halves), 0.0)


def _outside(points: FloatArray, halves: FloatArray) -> FloatArray:
    """Return the ways (..., 3) from the nearest points of boxes to points."""
    return points - np.clip(points, -halves, halves)


def _beyond_faces(start: FloatArray, way: FloatArray, halves: FloatArray) -> FloatArray:
    """Return how far (...) segments stay beyond one of the faces of boxes, m; negative: inside.

    Each face's distance is linear along a segment: the highest of them is least at an end, or where
    two are equal.
    """
    begins = np.concatenate([start - halves, -start - halves], axis=-1)
    slopes = np.concatenate([way, -way], axis=-1)
    first, second = np.triu_indices(begins.shape[-1], 1)
    change = slopes[..., first] - slopes[..., second]
    apart = np.where(change == 0.0, np.inf, change)
    equal = np.clip((begins[..., second] - begins[..., first]) / apart, 0.0, 1.0)
    places = np.concatenate(
        [equal, np.zeros_like(equal[..., :1]), np.ones_like(equal[..., :1])], -1
    )
    faces = begins[..., None, :] + places[..., None] * slopes[..., None, :]
    least: FloatArray = faces.max(axis=-1).min(axis=-1)
    return least


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = (a * b).sum(axis=-1)
    return product
