"""Arcs of a circle, as straight lines whose corners are rounded until nothing straight is left."""

from __future__ import annotations

import numpy as np

from robotd.api import FloatArray, InvalidArgument
from robotd_tool_space.rotations import pose_differences, rotation_matrices

ARC_TOLERANCE_M = 1e-4  # distance of the path from the circle
MAX_ANGLE = 0.25  # rad, of one corner
MIN_CORNERS = 3
STRAIGHT = 1e-6  # sine of the angle between the points below which they are on a line
SAME_M = 1e-6


def arc_poses(
    start: FloatArray, via: FloatArray, end: FloatArray
) -> tuple[list[FloatArray], float]:
    """Return the poses (4, 4) of lines that touch a circle, and the distance to round them by.

    The last one is ``end``. The tool turns evenly from the orientation of ``start`` to that of
    ``end``; that of ``via`` does not count.

    Args:
        start, via, end: (4, 4); the arc goes through their positions, in this order.

    Raises InvalidArgument: two are at the same place, or the three are on a line.
    """
    first, second, third = start[:3, 3], via[:3, 3], end[:3, 3]
    ways = np.array([second - first, third - second, first - third])
    lengths = np.linalg.norm(ways, axis=1)
    if lengths.min() < SAME_M:
        raise InvalidArgument("an arc needs three different places: start, `via` and `to`")
    normal = np.cross(ways[0], ways[1])
    size = float(np.linalg.norm(normal))
    if size < STRAIGHT * lengths[0] * lengths[1]:
        raise InvalidArgument("start, `via` and `to` of the arc are on a straight line")
    normal /= size
    # Of the circle through a triangle: the weights of its corners are sin 2α and so on.
    squares = np.roll(lengths**2, -1)  # opposite to the first, the second, the third
    weights = squares * (squares.sum() - 2.0 * squares)
    centre = (weights[:, None] * np.array([first, second, third])).sum(axis=0) / weights.sum()
    spoke = first - centre
    radius = float(np.linalg.norm(spoke))
    across = np.cross(normal, spoke)
    to = third - centre
    angle = float(np.arctan2(to @ across, to @ spoke)) % (2.0 * np.pi)
    most = min(np.sqrt(8.0 * ARC_TOLERANCE_M / radius), MAX_ANGLE)
    count = max(int(np.ceil(angle / most)), MIN_CORNERS)
    step = angle / count
    turned = pose_differences(start, end)[3:]
    poses = []
    for index in range(count):
        part = (index + 0.5) / count
        pose = np.eye(4)
        along = np.cos(part * angle) * spoke + np.sin(part * angle) * across
        pose[:3, 3] = centre + along / np.cos(0.5 * step)
        pose[:3, :3] = rotation_matrices(part * turned) @ start[:3, :3]
        poses.append(pose)
    return [*poses, end], radius * float(np.tan(0.5 * step))
