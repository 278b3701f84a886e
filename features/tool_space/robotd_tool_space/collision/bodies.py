"""Bodies of a chain's links, from the shapes of a URDF."""

from __future__ import annotations

import itertools
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from robotd.api import DescriptorError, FloatArray, IntArray
from robotd.api.models import UrdfRobot, read_limited, xml_root
from robotd_shared.mesh_files import MAX_MESH_BYTES
from robotd_shared.mesh_shapes import mesh_triangles, numbers, shape_pose
from robotd_tool_space.collision.distances import Shapes, segment_ways, widest_gaps
from robotd_tool_space.geometry.chain import Chain

FIXED = -1  # carrier of what does not move in the base


class Body(NamedTuple):
    """The sum of a box, a disc and a ball: a box, a cylinder, a sphere or a capsule.

    Attributes:
        pose: (4, 4) of its middle.
        halves: (3,) half of the size of the box, m.
        disc_m: radius of the disc, which is normal to the third axis.
        ball_m: radius of the ball.
    """

    pose: FloatArray
    halves: FloatArray
    disc_m: float = 0.0
    ball_m: float = 0.0


@dataclass(frozen=True, eq=False)
class Bodies:
    """Bodies of the links. Immutable; any thread.

    Attributes:
        links: names of the links, one for each of the c bodies.
        carriers: (c,) index of the moving link of the chain that carries it, or ``FIXED``.
        poses: (c, 4, 4) in the frame of the carrier.
        halves, discs, balls: (c, 3), (c,) and (c,), as of ``Body``.
    """

    links: tuple[str, ...]
    carriers: IntArray
    poses: FloatArray
    halves: FloatArray
    discs: FloatArray
    balls: FloatArray

    @classmethod
    def of_urdf(
        cls, urdf: UrdfRobot, path: Path, chain: Chain, others: Container[str] = ()
    ) -> Bodies:
        """Return bodies that contain the collision shapes of the links, or the visual ones.

        Links that joints beside those of the chain move are taken where these are at 0, as fingers,
        and left out where these are among ``others``, of other groups, or follow the chain.

        Raises DescriptorError: a mesh cannot be read, or there is no shape.
        """
        root = xml_root(read_limited(path, MAX_MESH_BYTES).decode(), path)
        found: list[tuple[str, int, Body]] = []
        for link in root.iterfind("link"):
            name = link.get("name", "")
            place = _place(urdf, chain, others, name)
            if place is None:
                continue
            carrier, pose = place
            shapes = link.findall("collision") or link.findall("visual")
            for body in _bodies(shapes, path):
                placed = body._replace(pose=pose @ body.pose)
                found.append((name, carrier, placed))
        if not found:
            raise DescriptorError("no link has a shape, which collisions need", path=path)
        return cls._of(found)

    @classmethod
    def _of(cls, found: Sequence[tuple[str, int, Body]]) -> Bodies:
        return cls(
            tuple(name for name, _, _ in found),
            np.array([carrier for _, carrier, _ in found]),
            np.array([body.pose for _, _, body in found]),
            np.array([body.halves for _, _, body in found]),
            np.array([body.disc_m for _, _, body in found]),
            np.array([body.ball_m for _, _, body in found]),
        )

    def with_tool(self, chain: Chain, name: str, tip: FloatArray, radius_m: float) -> Bodies:
        """Return these and the body of a tool, from its link to its ``tip`` (3,) in that, m."""
        pose = chain.end @ pose_along(np.zeros(3), tip)
        body = Body(pose, np.array([0.0, 0.0, 0.5 * np.linalg.norm(tip)]), ball_m=radius_m)
        return self.with_bodies([(name, len(chain.moving) - 1, body)])

    @property
    def moving(self) -> Bodies:
        """Return those that the chain moves."""
        moves = self.carriers != FIXED
        links = tuple(itertools.compress(self.links, moves))
        arrays = (self.carriers, self.poses, self.halves, self.discs, self.balls)
        return Bodies(links, *(array[moves] for array in arrays))

    def with_bodies(self, more: Iterable[tuple[str, int, Body]]) -> Bodies:
        """Return these and more, each with its name and carrier."""
        return self._of([*self.each(), *more])

    def each(self) -> Iterator[tuple[str, int, Body]]:
        """Yield each with its name and carrier."""
        bodies = map(Body, self.poses, self.halves, self.discs.tolist(), self.balls.tolist())
        return zip(self.links, self.carriers.tolist(), bodies, strict=True)

    def places(self, chain: Chain, positions: FloatArray) -> FloatArray:
        """Return the poses (k, c, 4, 4) of all bodies in the base, at positions (k, n)."""
        frames = chain.frames(positions)
        fixed = np.broadcast_to(np.eye(4), (len(frames), 1, 4, 4))
        placed: FloatArray = np.concatenate([frames, fixed], axis=1)[:, self.carriers] @ self.poses
        return placed

    def placed_segments(self, places: FloatArray) -> FloatArray:
        """Return ``segments`` (k, c, 2, 3) of bodies at ``places`` (k, c, 4, 4), in the base."""
        segments: FloatArray = self.segments @ np.swapaxes(places[..., :3, :3], -1, -2)
        return segments + places[..., None, :3, 3]

    def shapes(self, places: FloatArray, which: IntArray | slice = slice(None)) -> Shapes:
        """Return the bodies, or some of them, at their ``places`` (..., 4, 4)."""
        return Shapes(
            places[..., :3, 3],
            places[..., :3, :3],
            self.halves[which],
            self.discs[which],
            self.balls[which],
        )

    def distances(
        self, places: FloatArray, segments: FloatArray, pairs: IntArray, margin_m: float
    ) -> FloatArray:
        """Return the distances (k, p) of ``pairs`` (p, 2), of capsules where these are apart.

        Those less than ``margin_m`` are never more than the true ones, others at least that.

        Args:
            places: (k, c, 4, 4).
            segments: of ``placed_segments``.
        """
        first, second = pairs.T
        ways = segment_ways(segments[:, first], segments[:, second])
        distances = np.sqrt((ways**2).sum(axis=-1))
        distances -= self.radii[first] + self.radii[second]
        close = distances < margin_m
        if close.any():
            posture, pair = np.nonzero(close)
            gaps = widest_gaps(
                self.shapes(places[posture, first[pair]], first[pair]),
                self.shapes(places[posture, second[pair]], second[pair]),
                ways[close],
            )
            distances[close] = np.maximum(distances[close], gaps)
        return distances

    @cached_property
    def segments(self) -> FloatArray:
        """(c, 2, 3) ends of the segments within ``radii`` of which the bodies are.

        In their own frames. A body with its segment is one capsule.
        """
        longest = self.halves.argmax(axis=1)
        ends = np.zeros((len(longest), 2, 3))
        rows = np.arange(len(longest))
        ends[rows, 1, longest] = self.halves[rows, longest]
        ends[rows, 0, longest] = -self.halves[rows, longest]
        return ends

    @cached_property
    def radii(self) -> FloatArray:
        """(c,) distance from ``segments`` within which the bodies are, m."""
        across = np.sort(self.halves, axis=1)[:, :2]
        return np.linalg.norm(across, axis=1) + self.discs + self.balls


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


def _bodies(shapes: Sequence[Any], path: Path) -> Iterator[Body]:
    """Yield the body of each shape in the frame of the link."""
    for shape in shapes:
        geometry = next(iter(shape.find("geometry")), None)
        if geometry is not None:
            body = _own_body(geometry, path)
            yield body._replace(pose=shape_pose(shape) @ body.pose)


def _own_body(geometry: Any, path: Path) -> Body:
    match geometry.tag:
        case "sphere":
            return Body(np.eye(4), np.zeros(3), ball_m=float(numbers(geometry, "radius", 1)[0]))
        case "cylinder":
            radius, length = (float(numbers(geometry, key, 1)[0]) for key in ("radius", "length"))
            return Body(np.eye(4), np.array([0.0, 0.0, 0.5 * length]), disc_m=radius)
        case "box":
            return Body(np.eye(4), 0.5 * np.asarray(numbers(geometry, "size", 3)))
        case _:
            return enclosing_body(mesh_triangles(geometry, path).reshape(-1, 3))


def enclosing_body(points: FloatArray) -> Body:
    """Return the smaller of a capsule and a box along the main directions of points (k, 3)."""
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle, full_matrices=False)[2][::-1]  # the third: the longest
    if np.linalg.det(axes) < 0.0:
        axes[0] *= -1.0
    own = (points - middle) @ axes.T
    low, high = own.min(axis=0), own.max(axis=0)
    box = 0.5 * (high - low)
    radius, first, last = _enclosing_capsule(own)
    volume = np.pi * radius**2 * (last - first + 4.0 / 3.0 * radius)
    pose = np.eye(4)
    pose[:3, :3] = axes.T
    if volume < 8.0 * box.prod():
        pose[:3, 3] = middle + 0.5 * (first + last) * axes[2]
        return Body(pose, np.array([0.0, 0.0, 0.5 * (last - first)]), ball_m=radius)
    pose[:3, 3] = middle + 0.5 * (low + high) @ axes
    return Body(pose, box)


def _enclosing_capsule(points: FloatArray) -> tuple[float, float, float]:
    """Return radius, begin and end along the third axis of a capsule around points (k, 3)."""
    across = np.hypot(points[:, 0], points[:, 1])
    radius = float(across.max())
    # The end caps hold the part beyond the ends of the segment.
    reach = np.sqrt(radius**2 - across**2)
    first, last = float((points[:, 2] + reach).min()), float((points[:, 2] - reach).max())
    if first > last:  # a sphere
        first = last = 0.5 * (first + last)
    return radius, first, last


def pose_along(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return a pose (4, 4) in the middle of two points (3,) whose third axis goes along both."""
    way = end - start
    length = np.linalg.norm(way)
    pose = np.eye(4)
    if length > 0.0:
        least = np.eye(3)[np.abs(way).argmin()]
        pose[:3, 2] = way / length
        pose[:3, 0] = np.cross(least, pose[:3, 2])
        pose[:3, 0] /= np.linalg.norm(pose[:3, 0])
        pose[:3, 1] = np.cross(pose[:3, 2], pose[:3, 0])
    pose[:3, 3] = 0.5 * (start + end)
    return pose
