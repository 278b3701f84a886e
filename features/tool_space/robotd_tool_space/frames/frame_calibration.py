"""Frames from what an arm has touched: the tip of a tool by four poses, a frame by three points.

The tip p of a tool that touches one point c in several poses (R, t) of its link solves R·p + t = c
for all of them: linear in p and c. What is left is how far the touches are from one point. How well
p is known follows from how different the poses are turned: two turns about one axis leave the
component along it open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotd.api import FloatArray, InvalidArgument

MIN_POSES = 4
ALIKE_RATIO = 0.1  # of the worst known direction of the tip to the best known one, of at most √2
MIN_SIDE_M = 0.02  # of the triangle of a work frame
MIN_ANGLE_RAD = np.radians(15.0)


@dataclass(frozen=True, eq=False)
class ToolTip:
    """Tip of a tool in its link.

    Attributes:
        xyz_m: (3,).
        point_m: (3,) that was touched, in the base.
        errors_m: (k,) distance of each touch from it.
        known: 0 to 1; 1: the poses are as different as can be, below 0.1 they are too alike.
    """

    xyz_m: FloatArray
    point_m: FloatArray
    errors_m: FloatArray
    known: float


def tool_tip(links: Sequence[FloatArray]) -> ToolTip:
    """Return the tip that touches one point in all poses (4, 4) of its link.

    Raises InvalidArgument: less than four poses, or they are too alike.
    """
    if len(links) < MIN_POSES:
        raise InvalidArgument(f"{len(links)} poses: the tip of a tool needs {MIN_POSES} or more")
    poses = np.array(links)
    turns, places = poses[:, :3, :3], poses[:, :3, 3]
    # Without the point: each touch less the mean of all.
    apart, offsets = turns - turns.mean(axis=0), places.mean(axis=0) - places
    rows = apart.reshape(-1, 3)
    sizes = np.linalg.svd(rows, compute_uv=False)
    known = float(sizes[-1] / np.sqrt(len(links)))
    if known < ALIKE_RATIO:
        raise InvalidArgument(
            "the poses are too alike: turn the tool by 30° and more about different axes"
        )
    tip = np.linalg.lstsq(rows, offsets.reshape(-1), rcond=None)[0]
    touched = turns @ tip + places
    point = touched.mean(axis=0)
    return ToolTip(tip, point, np.linalg.norm(touched - point, axis=1), min(known, 1.0))


def frame_of_points(origin: FloatArray, on_x: FloatArray, in_plane: FloatArray) -> FloatArray:
    """Return the frame (4, 4) whose origin, x axis and xy plane go through three points (3,), m.

    ``in_plane`` is on the side of positive y. Raises InvalidArgument: they are too near to each
    other, or nearly in a line.
    """
    along, beside = on_x - origin, in_plane - origin
    sides = float(np.linalg.norm(along)), float(np.linalg.norm(beside))
    if min(sides) < MIN_SIDE_M:
        text = f"{1e3 * min(sides):.1f} mm between two points, at least {1e3 * MIN_SIDE_M:g} mm"
        raise InvalidArgument(f"the points are too near to each other: {text}")
    x, normal = along / sides[0], np.cross(along, beside) / (sides[0] * sides[1])
    sine = float(np.linalg.norm(normal))
    if sine < np.sin(MIN_ANGLE_RAD):
        angle = np.degrees(np.arcsin(sine))
        raise InvalidArgument(
            f"the points are nearly in a line: {angle:.1f}°, at least"
            f" {np.degrees(MIN_ANGLE_RAD):.0f}° at the origin"
        )
    z = normal / sine
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 2], frame[:3, 3] = x, np.cross(z, x), z, origin
    return frame
