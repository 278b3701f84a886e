"""Pairs of links that cannot collide, shown by their geometry, for an SRDF."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from robotd.api import FloatArray, UrdfJoint, UrdfRobot
from robotd_export.collision_shapes import Cover

MARGIN_M = 1e-3  # between shapes that never touch
MAX_JOINTS = 4  # between two links: more have too many positions
MAX_BOXES = 3000  # of positions, at once
MAX_SPLITS = 40

Step = tuple[UrdfJoint, bool]  # True: from the parent to the child


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
        way = _way(urdf, first, second)
        between = {link for joint, _ in way for link in (joint.parent, joint.child)}
        if not (between - {first, second}) & covers.keys():
            yield first, second, "Adjacent"
        elif not any(joint.moves for joint, _ in way):
            yield first, second, "Fixed"
        elif (
            covers[first].is_known
            and covers[second].is_known
            and is_always_apart(way, covers[first], covers[second])
        ):
            yield first, second, "Never"


def is_always_apart(way: Sequence[Step], first: Cover, second: Cover) -> bool:
    """Return True if the spheres of two links stay apart in all positions.

    Boxes of positions are divided until each is proven by the distance at its middle: within a
    box the spheres move at most by its half widths times their distances from the joints. False
    means not proven: they may still never collide.

    Args:
        way: joints from the first link to the second one.
        first, second: covers, each in the frame of its link.
    """
    moving = [joint for joint, _ in way if joint.moves]
    if len(moving) > MAX_JOINTS:
        return False
    lower, upper = np.array([_range(joint) for joint in moving]).T
    reach = _reaches(way, second)
    middles = ((lower + upper) / 2.0)[np.newaxis]
    halves = ((upper - lower) / 2.0)[np.newaxis]
    for _ in range(MAX_SPLITS):
        gaps = _gaps(way, middles, first, second) - MARGIN_M
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


def _way(urdf: UrdfRobot, first: str, second: str) -> list[Step]:
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


def _reaches(way: Sequence[Step], cover: Cover) -> FloatArray:
    """Return the greatest motion of the centres of ``cover`` per position of each joint."""
    reach = float(np.linalg.norm(cover.centers, axis=1).max())
    found = []
    for joint, is_down in way[::-1]:
        offset = float(np.linalg.norm(joint.origin[:3, 3]))
        reach += 0.0 if is_down else offset
        if joint.moves:
            is_linear = joint.type == "prismatic"
            found.append(1.0 if is_linear else reach)
            reach += max(map(abs, _range(joint))) if is_linear else 0.0
        reach += offset if is_down else 0.0
    return np.array(found[::-1])


def _gaps(way: Sequence[Step], positions: FloatArray, first: Cover, second: Cover) -> FloatArray:
    """Return the least distance between the spheres in each row of positions; below 0: inside."""
    points = np.broadcast_to(second.centers, (len(positions), *second.centers.shape))
    column = positions.shape[1]
    for joint, is_down in way[::-1]:
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
