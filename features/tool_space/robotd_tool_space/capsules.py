"""Links of a chain as capsules, from the shapes of a URDF."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robotd.api import DescriptorError, FloatArray, IntArray
from robotd.api.models import UrdfRobot, read_limited, xml_root
from robotd_shared.mesh_files import MAX_MESH_BYTES
from robotd_shared.mesh_shapes import mesh_triangles, numbers, shape_pose
from robotd_tool_space.chain import Chain

FIXED = -1  # carrier of what does not move in the base


@dataclass(frozen=True, eq=False)
class Capsules:
    """Capsules: all points within a radius of a line segment. Immutable; any thread.

    Attributes:
        links: names of the links, one for each of the c capsules.
        carriers: (c,) index of the moving link of the chain that carries it, or ``FIXED``.
        ends: (c, 2, 3) of the segments in the frame of the carrier, m.
        radii: (c,) m.
    """

    links: tuple[str, ...]
    carriers: IntArray
    ends: FloatArray
    radii: FloatArray

    @classmethod
    def of_urdf(
        cls, urdf: UrdfRobot, path: Path, chain: Chain, others: Container[str] = ()
    ) -> Capsules:
        """Return capsules that contain the collision shapes of the links, or the visual ones.

        Links that joints beside those of the chain move are taken where these are at 0, as fingers,
        and left out where these are among ``others``, of other groups, or follow the chain.

        Raises DescriptorError: a mesh cannot be read, or there is no shape.
        """
        root = xml_root(read_limited(path, MAX_MESH_BYTES).decode(), path)
        found: list[tuple[str, int, FloatArray, float]] = []
        for link in root.iterfind("link"):
            name = link.get("name", "")
            place = _place(urdf, chain, others, name)
            if place is None:
                continue
            shapes = link.findall("collision") or link.findall("visual")
            for ends, radius in _capsules(shapes, path):
                carrier, pose = place
                found.append((name, carrier, ends @ pose[:3, :3].T + pose[:3, 3], radius))
        if not found:
            raise DescriptorError("no link has a shape, which collisions need", path=path)
        return cls(
            tuple(name for name, _, _, _ in found),
            np.array([carrier for _, carrier, _, _ in found]),
            np.array([ends for _, _, ends, _ in found]),
            np.array([radius for _, _, _, radius in found]),
        )

    def segments(self, chain: Chain, positions: FloatArray) -> FloatArray:
        """Return the ends (k, c, 2, 3) of all segments in the base, at positions (k, n)."""
        frames = chain.frames(positions)
        fixed = np.broadcast_to(np.eye(4), (len(frames), 1, 4, 4))
        poses = np.concatenate([frames, fixed], axis=1)[:, self.carriers]
        turned = self.ends @ np.swapaxes(poses[..., :3, :3], -1, -2)
        ends: FloatArray = turned + poses[..., None, :3, 3]
        return ends


def _place(
    urdf: UrdfRobot, chain: Chain, others: Container[str], link: str
) -> tuple[int, FloatArray] | None:
    """Return the carrier of a link, and the link's frame in that; None: it has none."""
    pose = np.eye(4)
    while link != chain.base:
        joint = urdf.parent_joint.get(link)
        if joint is None:
            return None  # beside the base, or below it
        if joint.moves and joint.name in chain.moving:
            return chain.moving.index(joint.name), pose
        leader, _, _ = urdf.leader(joint, chain.names)
        if joint.moves and (leader.name in chain.names or leader.name in others):
            return None
        pose = joint.transform(urdf.position(joint, {})) @ pose
        link = joint.parent
    return FIXED, pose


def _capsules(shapes: Sequence[Any], path: Path) -> Iterator[tuple[FloatArray, float]]:
    """Yield the ends (2, 3) in the frame of the link, and the radius, of each shape."""
    for shape in shapes:
        geometry = next(iter(shape.find("geometry")), None)
        if geometry is None:
            continue
        ends, radius = _own_capsule(geometry, path)
        pose = shape_pose(shape)
        yield ends @ pose[:3, :3].T + pose[:3, 3], radius


def _own_capsule(geometry: Any, path: Path) -> tuple[FloatArray, float]:
    match geometry.tag:
        case "sphere":
            return np.zeros((2, 3)), float(numbers(geometry, "radius", 1)[0])
        case "cylinder":
            radius, length = (float(numbers(geometry, key, 1)[0]) for key in ("radius", "length"))
            return _along(2, length), radius
        case "box":
            size = numbers(geometry, "size", 3)
            axis = int(size.argmax())
            return _along(axis, size[axis]), float(np.hypot(*np.delete(size, axis))) / 2.0
        case _:
            return enclosing_capsule(mesh_triangles(geometry, path).reshape(-1, 3))


def _along(axis: int, length: float) -> FloatArray:
    ends = np.zeros((2, 3))
    ends[:, axis] = -0.5 * length, 0.5 * length
    return ends


def enclosing_capsule(points: FloatArray) -> tuple[FloatArray, float]:
    """Return ends (2, 3) and radius of a capsule along the longest direction of points (k, 3)."""
    middle = points.mean(axis=0)
    axis = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    along = (points - middle) @ axis
    across = np.linalg.norm(points - middle - along[:, None] * axis, axis=1)
    radius = float(across.max())
    # The end caps hold what is beyond the ends of the segment.
    reach = np.sqrt(radius**2 - across**2)
    first, last = float((along + reach).min()), float((along - reach).max())
    if first > last:  # a sphere
        first = last = 0.5 * (first + last)
    return middle + np.array([[first], [last]]) * axis, radius
