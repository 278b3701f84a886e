"""Collisions of an arm with itself and with walls."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robotd.api import (
    BoolArray,
    DescriptorError,
    FloatArray,
    IntArray,
    RobotDescriptor,
    did_you_mean,
    get_logger,
    read_urdf,
)
from robotd_tool_space.collision.bodies import FIXED, Bodies, Body
from robotd_tool_space.collision.distances import (
    Shapes,
    box_distances,
    plane_distances,
)
from robotd_tool_space.collision.motion_checks import MotionChecks
from robotd_tool_space.collision.scene_object import SceneObject, file_objects
from robotd_tool_space.geometry.chain import Chain
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.geometry.rotations import rpy_of
from robotd_tool_space.settings import (
    BoxSettings,
    CollisionSettings,
    PlaneSettings,
    ToolSpaceKeys,
)

log = get_logger("tool")

SAMPLED_POSTURES = 400  # postures by which pairs are left out
NEVER_APART = 0.99  # share of them in which two bodies that are left out are too close


@dataclass(frozen=True, eq=False)
class Collisions(MotionChecks):
    """Distances of an arm from itself and from walls. Immutable; any thread.

    Attributes:
        chain, bodies: of the arm.
        settings: of the robot's file.
        pairs: (p, 2) bodies whose distance counts.
        walled: (c, w) bodies that count with each plane, and then each box.
        left_out: names of the pairs that do not count because they are never apart.
    """

    chain: Chain
    bodies: Bodies
    settings: CollisionSettings
    pairs: IntArray
    walled: BoolArray
    left_out: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(
        cls,
        descriptor: RobotDescriptor,
        kinematics: Kinematics,
        settings: CollisionSettings,
        tool: str = "",
    ) -> Collisions:
        """Return the collision model of a joint group.

        ``tool``: name of a tool in the robot's file, whose body counts where it has a radius.

        Links that one joint connects do not count, nor do pairs of the settings' ``not_checked``,
        nor those that are too close in nearly all random postures: nothing could move.

        Raises DescriptorError: the URDF has no shapes, or one that cannot be read.
        """
        chain, path = kinematics.chain, descriptor.urdf
        if path is None:
            raise DescriptorError("collisions need a urdf")
        others = [name for name in descriptor.joint_names if name not in chain.names]
        urdf = read_urdf(path)
        bodies = Bodies.of_urdf(urdf, path, chain, others)
        chosen = descriptor.settings(ToolSpaceKeys).tool_space.tools.get(tool)
        if chosen is not None and chosen.radius_m is not None:
            tip = np.array(chosen.xyz_m)
            bodies = bodies.with_tool(chain, f"tool {tool}", tip, chosen.radius_m)
        for name in itertools.chain.from_iterable(settings.not_checked):
            if name not in urdf.links:
                text = f"no link {name!r} in {path.name}{did_you_mean(name, urdf.links)}"
                raise descriptor.problem("tool_space.collisions.not_checked", text)
        pairs = [
            (first, second)
            for first, second in itertools.combinations(range(len(bodies.links)), 2)
            if settings.links
            and abs(bodies.carriers[first] - bodies.carriers[second]) > 1
            and not settings.leaves_out(bodies.links[first], bodies.links[second])
        ]
        moving = np.repeat(bodies.carriers[:, None] != FIXED, len(_walls(settings)), axis=1)
        every = cls(chain, bodies, settings, np.array(pairs, int).reshape(-1, 2), moving)
        rounded = [item for item in file_objects(settings) if item.shape in ("cylinder", "sphere")]
        return every._without_constant(kinematics).with_objects(rounded)

    @property
    def margin_m(self) -> float:
        return self.settings.margin_m

    @property
    def joints(self) -> tuple[str, ...]:
        return self.chain.names

    @cached_property
    def names(self) -> tuple[tuple[str, str], ...]:
        """Names of both bodies of each distance."""
        links, walls = self.bodies.links, _walls(self.settings)
        own = [(links[first], links[second]) for first, second in self.pairs]
        return (*own, *((links[pair], walls[wall]) for pair, wall in np.argwhere(self.walled)))

    def with_objects(self, objects: Sequence[SceneObject]) -> Collisions:
        """Return these and more bodies: around the arm, or carried by its tool; each counts.

        Planes and boxes around it are walls; the others are bodies that do not move in the base, or
        that move with the last joint.
        """
        if not objects:
            return self
        around = {item.name: item for item in objects if not item.attached}
        planes = {name: _plane(item) for name, item in around.items() if item.shape == "plane"}
        boxes = {name: _box(item) for name, item in around.items() if item.shape == "box"}
        more = [item for item in objects if item.name not in planes and item.name not in boxes]
        bodies = self.bodies.with_bodies((item.name, *self._carried(item)) for item in more)
        settings = self.settings
        added = self._pairs_of_more(bodies, [item.touch_links for item in more])
        pairs = np.array([*self.pairs.tolist(), *added], int).reshape(-1, 2)
        count, all_planes = len(self.bodies.links), len(settings.planes) + len(planes)
        walls = all_planes + len(settings.boxes) + len(boxes)
        walled = np.repeat(bodies.carriers[:, None] != FIXED, walls, axis=1)
        known = [*range(len(settings.planes)), *range(all_planes, all_planes + len(settings.boxes))]
        walled[:count, known] = self.walled
        update = {
            "planes": {**settings.planes, **planes},
            "boxes": {**settings.boxes, **boxes},
        }
        changed = settings.model_copy(update=update)
        return replace(self, bodies=bodies, settings=changed, pairs=pairs, walled=walled)

    def _carried(self, item: SceneObject) -> tuple[int, Body]:
        if not item.attached:
            return FIXED, item.body
        body = item.body
        return len(self.chain.moving) - 1, body._replace(pose=self.chain.end @ body.pose)

    def _pairs_of_more(
        self, bodies: Bodies, touch_links: Sequence[frozenset[str]]
    ) -> Iterator[tuple[int, int]]:
        """Yield the pairs of the bodies that are not among these, with each other body.

        Except those with the links that each of them may touch.
        """
        carriers, count = bodies.carriers.tolist(), len(self.bodies.links)
        for second in range(count, len(carriers)):
            for first in range(second):
                one, other = carriers[first], carriers[second]
                is_link, is_fixed = first < count, other == FIXED
                if is_fixed or not is_link:  # an object around the arm, and what moves
                    counts = (one == FIXED) != is_fixed
                else:  # a carried object, and a link
                    counts = self.settings.links and abs(one - other) > 1
                    counts &= bodies.links[first] not in touch_links[second - count]
                if counts:
                    yield first, second

    def too_close(self, positions: FloatArray, name: str) -> str:
        """Return what is too close to a body at ``positions`` (n,), by its name; "": nothing."""
        distances = self.distances(positions[None])[0]
        close = distances < self.settings.margin_m
        close &= np.array([name in pair for pair in self.names], np.bool_)
        if not close.any():
            return ""
        first, second = self.names[int(np.where(close, distances, np.inf).argmin())]
        apart = 1e3 * max(float(np.where(close, distances, np.inf).min()), 0.0)
        how = f"are {apart:.1f} mm apart" if apart > 0.0 else "touch"
        return f"{first} and {second} {how} already: only motion that leads away is possible"

    def distances(self, positions: FloatArray) -> FloatArray:
        """Return the distances (k, d) of ``names`` at positions (k, n), m; negative: overlaps.

        Those of own links and boxes that are less than the margin are never more than the true
        ones, others at least the margin.
        """
        places = self.bodies.places(self.chain, positions)
        segments = self.bodies.placed_segments(places)
        own = self.bodies.distances(places, segments, self.pairs, self.margin_m)
        if not self.walled.any():
            return own
        shapes = self.bodies.shapes(places)
        parts = []
        if self.settings.planes:
            parts.append(plane_distances(shapes, *self._planes))
        if self.settings.boxes:
            parts.append(self._box_distances(shapes, segments))
        return np.concatenate([own, np.concatenate(parts, axis=-1)[:, self.walled]], axis=1)

    def _box_distances(self, shapes: Shapes, segments: FloatArray) -> FloatArray:
        """Return the distances (k, c, w) from boxes: of their faces, where these are far enough."""
        faces = plane_distances(shapes, *self._faces)
        poses, halves = self._boxes
        distances: FloatArray = faces.reshape(*faces.shape[:2], len(poses), -1).max(axis=-1)
        near = (distances < self.settings.margin_m).any(axis=(0, 1))
        if near.any():
            rounded = box_distances(segments, poses[near], halves[near])
            rounded -= self.bodies.radii[:, None]
            distances[..., near] = np.maximum(distances[..., near], rounded)
        return distances

    def _without_constant(self, kinematics: Kinematics) -> Collisions:
        """Return these without what is always, or nearly always, too close."""
        lower = np.where(np.isfinite(kinematics.lower), kinematics.lower, -np.pi)
        upper = np.where(np.isfinite(kinematics.upper), kinematics.upper, np.pi)
        positions = np.random.default_rng(0).uniform(lower, upper, (SAMPLED_POSTURES, len(lower)))
        close = self.distances(positions) < self.settings.margin_m
        out, count = close.mean(axis=0) > NEVER_APART, len(self.pairs)
        # A link of several shapes is named once.
        left_out = (pair for pair, is_out in zip(self.names, out, strict=True) if is_out)
        names = tuple(dict.fromkeys(left_out))
        for pair in names:
            log.info("collisions of two bodies are not checked", bodies=list(pair))
        walled = self.walled.copy()
        walled[self.walled] = ~out[count:]
        return replace(self, pairs=self.pairs[~out[:count]], walled=walled, left_out=names)

    @cached_property
    def _planes(self) -> tuple[FloatArray, FloatArray]:
        planes = self.settings.planes.values()
        normals = np.array([plane.normal for plane in planes], np.float64)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return normals, np.array([plane.distance_m for plane in planes])

    @cached_property
    def _boxes(self) -> tuple[FloatArray, FloatArray]:
        boxes = self.settings.boxes.values()
        halves = 0.5 * np.array([box.size_m for box in boxes])
        return np.array([box.pose for box in boxes]), halves

    @cached_property
    def _faces(self) -> tuple[FloatArray, FloatArray]:
        """The planes of the six faces of each box, one box after the other."""
        poses, halves = self._boxes
        normals = np.swapaxes(poses[:, :3, :3], -1, -2)
        normals = np.concatenate([normals, -normals], axis=1)
        offsets = (normals @ poses[:, :3, 3, None])[..., 0] + np.tile(halves, 2)
        return normals.reshape(-1, 3), offsets.ravel()


def _plane(item: SceneObject) -> PlaneSettings:
    normal = item.pose[:3, 2]
    return PlaneSettings(normal=tuple(normal.tolist()), distance_m=float(normal @ item.pose[:3, 3]))


def _box(item: SceneObject) -> BoxSettings:
    x, y, z = item.size_m
    return BoxSettings(
        size_m=(x, y, z),
        xyz_m=tuple(item.pose[:3, 3].tolist()),
        rpy_rad=tuple(rpy_of(item.pose).tolist()),
    )


def _walls(settings: CollisionSettings) -> list[str]:
    return [*settings.planes, *settings.boxes]
