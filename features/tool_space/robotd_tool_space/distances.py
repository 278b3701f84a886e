"""Distances of line segments from each other, and from planes and boxes."""

from __future__ import annotations

import numpy as np

from robotd.api import FloatArray

PARALLEL = 1e-12
BISECTIONS = 10  # of a segment, to its point that is nearest to a box


def segment_distances(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the distances (...) of segments (..., 2, 3) from each other, m.

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
    apart = between + s[..., None] * along - t[..., None] * across
    return np.sqrt(_dot(apart, apart))


def plane_distances(segments: FloatArray, normals: FloatArray, offsets: FloatArray) -> FloatArray:
    """Return the distances (..., c, w) of segments (..., c, 2, 3) from planes, m.

    Negative beyond a plane: ``normals`` (w, 3) are of length 1 and point to where the arm may be,
    ``offsets`` (w,) are the distances of the planes from the origin along them.
    """
    nearest: FloatArray = (segments @ normals.T).min(axis=-2) - offsets
    return nearest


def box_distances(segments: FloatArray, poses: FloatArray, halves: FloatArray) -> FloatArray:
    """Return the distances (..., c, w) of segments (..., c, 2, 3) from boxes, m; 0 inside.

    The distance of a point from a box is convex along a line: its slope is bisected.

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
    return np.linalg.norm(_outside(start + high[..., None] * way, halves), axis=-1)


def _outside(points: FloatArray, halves: FloatArray) -> FloatArray:
    """Return the ways (..., 3) from the nearest points of boxes to points."""
    return points - np.clip(points, -halves, halves)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = (a * b).sum(axis=-1)
    return product
