"""Pairs of links that cannot collide, shown by their geometry, for an SRDF."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from robotd.api import DescriptorError, FloatArray, UrdfJoint, UrdfRobot
from robotd.api.models import xml_root
from robotd_shared.mesh_shapes import mesh_triangles, numbers, shape_pose

MARGIN_M = 1e-3  # between shapes that never touch
MAX_JOINTS = 4  # between two links: more have too many positions
MAX_BOXES = 3000  # of positions, at once
MAX_SPLITS = 40

Step = tuple[UrdfJoint, bool]  # True: from the parent to the child
MAX_SLICES = 6  # of a shape, along its longest side


@dataclass(frozen=True)
class Cover:
    """Spheres that contain the collision shapes of a link.

    Attributes:
        centers: in the frame of the link, m; shape (n, 3).
        radii: m; shape (n,).
        is_known: False where a shape could not be read, so that the spheres do not contain it.
    """

    centers: FloatArray
    radii: FloatArray
    is_known: bool


def collision_covers(text: str, path: Path) -> dict[str, Cover]:
    """Return the cover of each link that has collision shapes.

    Boxes, cylinders, spheres and STL files are known; other meshes are not.

    Args:
        path: of its file, which relative names of meshes start from.
    """
    covers = {}
    for link in xml_root(text, path).iterfind("link"):
        found = [_spheres(element, path) for element in link.iterfind("collision")]
        known = [spheres for spheres in found if spheres is not None]
        if found:
            centers = np.concatenate([np.empty((0, 3)), *(centers for centers, _ in known)])
            radii = np.concatenate([np.empty(0), *(radii for _, radii in known)])
            covers[link.get("name", "")] = Cover(centers, radii, len(known) == len(found))
    return covers


def _spheres(collision: Any, path: Path) -> tuple[FloatArray, FloatArray] | None:
    """Return centres and radii in the frame of the link; None for an unknown shape."""
    found = _own_spheres(collision.find("geometry"), path)
    if found is None:
        return None
    centers, radii = found
    pose = shape_pose(collision)
    return centers @ pose[:3, :3].T + pose[:3, 3], radii


def _own_spheres(geometry: Any, path: Path) -> tuple[FloatArray, FloatArray] | None:
    for shape in geometry if geometry is not None else ():
        match shape.tag:
            case "sphere":
                return np.zeros((1, 3)), numbers(shape, "radius", 1)
            case "cylinder":
                radius, length = (float(numbers(shape, key, 1)[0]) for key in ("radius", "length"))
                return _slices(np.array([2.0 * radius, 2.0 * radius, length]), 2, radius)
            case "box":
                size = numbers(shape, "size", 3)
                axis = int(np.argmax(size))
                return _slices(size, axis, float(np.hypot(*np.delete(size, axis))) / 2.0)
            case "mesh":
                return _mesh_spheres(shape, path)
    return None


def _slices(size: FloatArray, axis: int, across: float) -> tuple[FloatArray, FloatArray]:
    """Cover a prism about ``axis``, centred at 0, whose edges have the distance ``across``."""
    count = int(np.clip(np.ceil(size[axis] / (2.0 * across or 1.0)), 1, MAX_SLICES))
    thickness = size[axis] / count
    centers = np.zeros((count, 3))
    centers[:, axis] = (np.arange(count) + 0.5) * thickness - size[axis] / 2.0
    return centers, np.full(count, np.hypot(across, thickness / 2.0))


def _mesh_spheres(mesh: Any, path: Path) -> tuple[FloatArray, FloatArray] | None:
    try:
        triangles = mesh_triangles(mesh, path)
    except DescriptorError:
        return None
    return _covering(triangles)


def _covering(triangles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cover triangles (n, 3, 3) by the spheres around slices of them.

    A sphere that holds the corners of a triangle holds the triangle.
    """
    middles = triangles.mean(axis=1)
    extent = np.ptp(triangles.reshape(-1, 3), axis=0)
    axis = int(np.argmax(extent))
    edges = np.quantile(middles[:, axis], np.linspace(0.0, 1.0, MAX_SLICES + 1)[1:-1])
    slice_of = np.searchsorted(edges, middles[:, axis])
    centers, radii = [], []
    for number in np.unique(slice_of):
        points = triangles[slice_of == number].reshape(-1, 3)
        center = (points.min(axis=0) + points.max(axis=0)) / 2.0
        centers.append(center)
        radii.append(np.linalg.norm(points - center, axis=1).max())
    return np.array(centers), np.array(radii)


def disabled_collisions(
    urdf: UrdfRobot, covers: Mapping[str, Cover]
) -> Iterator[tuple[str, str, str]]:
    """Yield pairs of links, each with the reason.

    ``Adjacent``: a joint connects them, perhaps through links without a shape; they touch there.
    ``Fixed``: no joint between them moves. ``Never``: they are apart, by ``MARGIN_M``, in all
    positions of the joints between them.

    Args:
        covers: of the links with collision shapes.
    """
    for first, second in combinations(covers, 2):
        steps = _steps_between(urdf, first, second)
        between = {link for joint, _ in steps for link in (joint.parent, joint.child)}
        if not (between - {first, second}) & covers.keys():
            yield first, second, "Adjacent"
        elif not any(joint.moves for joint, _ in steps):
            yield first, second, "Fixed"
        elif (
            covers[first].is_known
            and covers[second].is_known
            and is_always_apart(steps, covers[first], covers[second])
        ):
            yield first, second, "Never"


def is_always_apart(steps: Sequence[Step], first: Cover, second: Cover) -> bool:
    """Return True if the spheres of two links stay apart in all positions.

    Boxes of positions are divided until each is proven by the distance at its middle: within a
    box the spheres move at most by its half widths times their distances from the joints. False
    means not proven: they may still never collide.

    Args:
        steps: joints from the first link to the second one.
        first, second: covers, each in the frame of its link.
    """
    moving = [joint for joint, _ in steps if joint.moves]
    if len(moving) > MAX_JOINTS:
        return False
    lower, upper = np.array([_range(joint) for joint in moving]).T
    reach = _reaches(steps, second)
    middles = ((lower + upper) / 2.0)[np.newaxis]
    halves = ((upper - lower) / 2.0)[np.newaxis]
    for _ in range(MAX_SPLITS):
        gaps = _gaps(steps, middles, first, second) - MARGIN_M
        if (gaps <= 0.0).any():
            return False
        motion = halves * reach
        is_open = gaps <= motion.sum(axis=1)
        if not is_open.any():
            return True
        middles, halves, motion = middles[is_open], halves[is_open], motion[is_open]
        if 2 * len(middles) > MAX_BOXES:
            return False
        row, widest = np.arange(len(middles)), motion.argmax(axis=1)
        halves[row, widest] /= 2.0
        below, above = middles.copy(), middles.copy()
        below[row, widest] -= halves[row, widest]
        above[row, widest] += halves[row, widest]
        middles, halves = np.concatenate([below, above]), np.concatenate([halves, halves])
    return False


def _steps_between(urdf: UrdfRobot, first: str, second: str) -> list[Step]:
    """Return the joints from one link to another, up the tree and down."""
    up, down = _to_root(urdf, first), _to_root(urdf, second)
    while up and down and up[-1] is down[-1]:
        up.pop()
        down.pop()
    return [*((joint, False) for joint in up), *((joint, True) for joint in down[::-1])]


def _to_root(urdf: UrdfRobot, link: str) -> list[UrdfJoint]:
    found = []
    while link != urdf.root:
        found.append(urdf.parent_joint[link])
        link = found[-1].parent
    return found


def _range(joint: UrdfJoint) -> tuple[float, float]:
    """Return the positions of a joint, a full turn at most where it turns."""
    lower, upper = joint.lower, joint.upper
    if joint.type == "prismatic" or (upper - lower) < 2.0 * np.pi:
        return lower, upper
    return -np.pi, np.pi


def _reaches(steps: Sequence[Step], cover: Cover) -> FloatArray:
    """Return the greatest motion of the centres of ``cover`` per position of each joint."""
    reach = float(np.linalg.norm(cover.centers, axis=1).max())
    found = []
    for joint, is_down in steps[::-1]:
        offset = float(np.linalg.norm(joint.origin[:3, 3]))
        reach += 0.0 if is_down else offset
        if joint.moves:
            is_linear = joint.type == "prismatic"
            found.append(1.0 if is_linear else reach)
            reach += max(map(abs, _range(joint))) if is_linear else 0.0
        reach += offset if is_down else 0.0
    return np.array(found[::-1])


def _gaps(steps: Sequence[Step], positions: FloatArray, first: Cover, second: Cover) -> FloatArray:
    """Return the least distance between the spheres in each row of positions; below 0: inside."""
    points = np.broadcast_to(second.centers, (len(positions), *second.centers.shape))
    column = positions.shape[1]
    for joint, is_down in steps[::-1]:
        column -= 1 if joint.moves else 0
        position = positions[:, column] if joint.moves else np.zeros(len(positions))
        points = _moved(points, joint, position, is_down=is_down)
    distance = np.linalg.norm(points[:, :, np.newaxis] - first.centers, axis=3)
    gaps: FloatArray = distance - second.radii[:, np.newaxis] - first.radii
    least: FloatArray = gaps.reshape(len(positions), -1).min(axis=1)
    return least


def _moved(
    points: FloatArray, joint: UrdfJoint, position: FloatArray, *, is_down: bool
) -> FloatArray:
    """Return points (n, m, 3) in the frame of the other side of a joint."""
    turn, shift = joint.origin[:3, :3], joint.origin[:3, 3]
    if not is_down:
        return _displaced((points - shift) @ turn, joint, -position)
    return _displaced(points, joint, position) @ turn.T + shift


def _displaced(points: FloatArray, joint: UrdfJoint, position: FloatArray) -> FloatArray:
    """Move points (n, m, 3) by positions (n,) of a joint, in its frame (Rodrigues)."""
    if not joint.moves:
        return points
    axis, amount = joint.axis, position[:, np.newaxis, np.newaxis]
    if joint.type == "prismatic":
        return points + amount * axis
    cross = np.cross(axis, points)
    along = (points @ axis)[..., np.newaxis] * axis
    moved: FloatArray = (
        points * np.cos(amount) + cross * np.sin(amount) + along * (1.0 - np.cos(amount))
    )
    return moved
