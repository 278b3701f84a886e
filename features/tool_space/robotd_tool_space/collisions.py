"""Collisions of an arm with itself and with walls: distances, and checks of motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robotd.api import (
    BoolArray,
    DescriptorError,
    FloatArray,
    IntArray,
    RobotDescriptor,
    get_logger,
    read_urdf,
)
from robotd.api.robots import Trajectory, distinct, reject
from robotd_tool_space.capsules import FIXED, Capsules
from robotd_tool_space.chain import Chain
from robotd_tool_space.kinematics import Kinematics
from robotd_tool_space.settings import CollisionSettings

log = get_logger("tool")

STEP_S = 0.005  # of a path between two checks
CHUNK_POSTURES = 400  # postures in one computation
SAMPLED_POSTURES = 400  # postures by which pairs are left out
CLOSE_SHARE = 0.5  # share of them in which two links that are too close are left out
WALL_CLOSE_SHARE = 0.99  # share from which a link is left out with a wall: it is mounted there
ROUNDING_M = 1e-9
PARALLEL = 1e-12
BISECTIONS = 10  # of a segment, to its point that is nearest to a box
INSIDE_M = 0.005  # from a box; what reaches into it is not found farther outside


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


@dataclass(frozen=True, eq=False)
class Collisions:
    """Distances of an arm from itself and from walls. Immutable; any thread.

    Attributes:
        chain, capsules: of the arm.
        settings: of the robot's file.
        pairs: (p, 2) capsules whose distance counts.
        walled: (c, w) capsules that count with each plane, and then each box.
    """

    chain: Chain
    capsules: Capsules
    settings: CollisionSettings
    pairs: IntArray
    walled: BoolArray

    @classmethod
    def of(
        cls, descriptor: RobotDescriptor, kinematics: Kinematics, settings: CollisionSettings
    ) -> Collisions:
        """Return those of a joint group.

        Links that one joint connects do not count, nor do those that are too close in the middle of
        the joints' ranges, or in half of random postures: their capsules are too thick.

        Raises DescriptorError: the URDF has no shapes, or one that cannot be read.
        """
        chain, path = kinematics.chain, descriptor.urdf
        if path is None:
            raise DescriptorError("needs a urdf", key="tool_space.collisions")
        others = [name for name in descriptor.joint_names if name not in chain.names]
        capsules = Capsules.of_urdf(read_urdf(path), path, chain, others)
        first, second = np.triu_indices(len(capsules.links), 1)
        apart = np.abs(capsules.carriers[first] - capsules.carriers[second]) > 1
        apart &= settings.links
        pairs = np.stack([first, second], axis=1)[apart]
        moving = np.repeat(capsules.carriers[:, None] != FIXED, len(_walls(settings)), axis=1)
        every = cls(chain, capsules, settings, pairs, moving)
        return every._without_constant(kinematics)

    @cached_property
    def names(self) -> tuple[tuple[str, str], ...]:
        """Names of both bodies of each distance."""
        links, walls = self.capsules.links, _walls(self.settings)
        own = [(links[first], links[second]) for first, second in self.pairs]
        return (*own, *((links[each], walls[wall]) for each, wall in np.argwhere(self.walled)))

    def distances(self, positions: FloatArray) -> FloatArray:
        """Return the distances (k, d) of ``names`` at positions (k, n), m; negative: overlaps."""
        segments = self.capsules.segments(self.chain, positions)
        radii, pairs = self.capsules.radii, self.pairs
        own = segment_distances(segments[:, pairs[:, 0]], segments[:, pairs[:, 1]])
        own -= radii[pairs].sum(axis=1)
        if not self.walled.any():
            return own
        parts = []
        if self.settings.planes:
            parts.append(plane_distances(segments, *self._planes))
        if self.settings.boxes:
            parts.append(box_distances(segments, *self._boxes))
        walls = np.concatenate(parts, axis=-1) - radii[:, None]
        return np.concatenate([own, walls[:, self.walled]], axis=1)

    def check_path(self, trajectory: Trajectory) -> None:
        """Raise TrajectoryRejected where two bodies come too close: with both, time and place."""
        duration_s = trajectory.duration_s
        times_s = np.linspace(0.0, duration_s, int(np.ceil(duration_s / STEP_S)) + 1)
        least = None
        for first in range(0, len(times_s), CHUNK_POSTURES):
            part_s = times_s[first : first + CHUNK_POSTURES]
            distances = self.distances(trajectory.evaluate(part_s)[0])
            if least is None:
                least = self._least(distances[0])
            close = distances < least
            if close.any():
                at = int(close.any(axis=1).argmax())
                time_s = float(part_s[at])
                place = f"at {time_s:.2f} s ({100.0 * time_s / duration_s:.0f} %)"
                raise reject(f"{place} {self._text(distances[at], close[at])}")

    def obstacle(self, positions: FloatArray, stopped: FloatArray) -> str:
        """Return what comes too close on the way from ``positions`` (n,) to ``stopped`` (n,).

        Nothing is known to be apart from a joint that may be anywhere: it is named, too.
        """
        if not (known := np.isfinite(stopped)).all():
            return f"the position of {self.chain.names[int(known.argmin())]} is not known"
        way = np.stack([positions, 0.5 * (positions + stopped), stopped])
        distances = self.distances(way)
        close = distances[1:] < self._least(distances[0])
        if not close.any():
            return ""
        at = int(close.any(axis=1).argmax())
        return self._text(distances[1 + at], close[at])

    def _least(self, distances: FloatArray) -> FloatArray:
        """Return the least distances of a motion from ``distances`` (d,): it may lead away."""
        return np.minimum(self.settings.margin_m, distances - ROUNDING_M)

    def _text(self, distances: FloatArray, close: BoolArray) -> str:
        number = int(np.where(close, distances, np.inf).argmin())
        first, second = self.names[number]
        distance, margin = float(distances[number]), self.settings.margin_m
        apart, least = distinct(1e3 * max(distance, 0.0), 1e3 * margin, 2)
        how = "would touch" if distance <= 0.0 else f"would be {apart} mm apart"
        return f"{first} and {second} {how}, the least distance is {least} mm"

    def _without_constant(self, kinematics: Kinematics) -> Collisions:
        """Return these without what is always, or nearly always, too close."""
        lower = np.where(np.isfinite(kinematics.lower), kinematics.lower, -np.pi)
        upper = np.where(np.isfinite(kinematics.upper), kinematics.upper, np.pi)
        random = np.random.default_rng(0).uniform(lower, upper, (SAMPLED_POSTURES, len(lower)))
        positions = np.vstack([0.5 * (lower + upper), random])
        close = self.distances(positions) < self.settings.margin_m
        share, count = close.mean(axis=0), len(self.pairs)
        left_out = (share > CLOSE_SHARE) | close[0]
        left_out[count:] = share[count:] > WALL_CLOSE_SHARE
        for names in [each for each, out in zip(self.names, left_out, strict=True) if out]:
            log.info("collisions of two bodies are not checked", bodies=list(names))
        walled = self.walled.copy()
        walled[self.walled] = ~left_out[count:]
        pairs = self.pairs[~left_out[:count]]
        return Collisions(self.chain, self.capsules, self.settings, pairs, walled)

    @cached_property
    def _planes(self) -> tuple[FloatArray, FloatArray]:
        planes = self.settings.planes.values()
        normals = np.array([each.normal for each in planes], np.float64)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return normals, np.array([each.distance_m for each in planes])

    @cached_property
    def _boxes(self) -> tuple[FloatArray, FloatArray]:
        boxes = self.settings.boxes.values()
        halves = 0.5 * np.array([each.size_m for each in boxes])
        return np.array([each.pose for each in boxes]), halves


def _walls(settings: CollisionSettings) -> list[str]:
    return [*settings.planes, *settings.boxes]
