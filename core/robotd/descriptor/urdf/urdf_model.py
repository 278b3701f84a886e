"""Links and joints of a URDF, and transforms between the links."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robotd.arrays import FloatArray

FIXED = "fixed"
HELD_TYPES = (FIXED, "floating", "planar")  # no axis of the robot moves them
MOVING_TYPES = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Mimic:
    """Position of a joint that follows another: multiplier · position + offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class UrdfLink:
    """One link.

    Attributes:
        line: of its element.
        mass: kg; None without an inertial.
        center: of mass in the frame of the link, m; shape (3,).
        inertia: about the centre of mass, in the axes of the link, kg·m²; shape (3, 3).
        radius: of its collision or visual cylinder or sphere, m; None without one.
    """

    name: str
    line: int
    mass: float | None
    center: FloatArray
    inertia: FloatArray
    radius: float | None


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """One joint; rad, or m for a prismatic one.

    Attributes:
        type: one of ``MOVING_TYPES`` or ``HELD_TYPES``.
        origin: frame of the joint in that of its parent; shape (4, 4).
        axis: unit vector in the frame of the joint; shape (3,).
        lower, upper: the tighter of hard and soft limits, as the file has them: they may leave no
            range. -inf and inf for a continuous joint and one without limits.
        velocity, effort: None where the file has none; a velocity of 0 is none.
        soft: limits of its <safety_controller>; None without.
    """

    name: str
    line: int
    type: str
    parent: str
    child: str
    origin: FloatArray
    axis: FloatArray
    lower: float
    upper: float
    velocity: float | None
    effort: float | None
    soft: tuple[float, float] | None
    mimic: Mimic | None

    @property
    def moves(self) -> bool:
        """True for a joint of one axis; False for a fixed, floating or planar one."""
        return self.type in MOVING_TYPES

    @property
    def has_range(self) -> bool:
        """True for limits that leave a range, and for a joint that needs none."""
        return self.lower < self.upper and (self.type == "continuous" or self.lower > -np.inf)

    def transform(self, position: float) -> FloatArray:
        """Return the frame of the child in that of the parent; shape (4, 4)."""
        return self.origin @ self.motion(position)

    def motion(self, position: float) -> FloatArray:
        """Return the frame of the child in that of the joint; shape (4, 4)."""
        motion = np.eye(4)
        if self.type == "prismatic":
            motion[:3, 3] = self.axis * position
        elif self.moves:
            motion[:3, :3] = rotation(self.axis, position)
        return motion


@dataclass(frozen=True, eq=False)
class UrdfRobot:
    """A tree of links; valid, as ``read_urdf`` checks it.

    Attributes:
        name: of the robot; "" where the file has none.
        root: the link without a parent.
        joints: depth first from the root, siblings in the order of the file.
        notes: what other readers refuse or show differently.
    """

    name: str
    root: str
    links: Mapping[str, UrdfLink]
    joints: tuple[UrdfJoint, ...]
    notes: tuple[str, ...] = ()

    @cached_property
    def joint(self) -> Mapping[str, UrdfJoint]:
        """The joints by name."""
        return {joint.name: joint for joint in self.joints}

    @cached_property
    def parent_joint(self) -> Mapping[str, UrdfJoint]:
        """The joint that holds each link, by link; the root has none."""
        return {joint.child: joint for joint in self.joints}

    def subtree(self, link: str) -> list[str]:
        """Return ``link`` and all links that it carries."""
        carried = {link: None}
        for joint in self.joints:  # a parent comes before its children
            if joint.parent in carried:
                carried[joint.child] = None
        return list(carried)

    def carries(self, joint: UrdfJoint) -> list[UrdfJoint]:
        """Return the moving joints beyond ``joint``."""
        links = self.subtree(joint.child)
        return [joint for joint in self.joints if joint.moves and joint.parent in links]

    def position(self, joint: UrdfJoint, positions: Mapping[str, float]) -> float:
        """Return the position of ``joint``: its own, that of a mimic, or 0."""
        leader, multiplier, offset = self.leader(joint)
        return multiplier * positions.get(leader.name, 0.0) + offset

    def leader(
        self, joint: UrdfJoint, known: Container[str] = ()
    ) -> tuple[UrdfJoint, float, float]:
        """Return the joint that ``joint`` follows, itself where it follows none, and how.

        Its position is multiplier · that of the leader + offset.

        Args:
            joint: of this robot.
            known: names of joints that are taken as leaders even where they are mimics.
        """
        multiplier, offset = 1.0, 0.0
        while joint.mimic and joint.name not in known and joint.mimic.joint in self.joint:
            offset += multiplier * joint.mimic.offset
            multiplier *= joint.mimic.multiplier
            joint = self.joint[joint.mimic.joint]
        return joint, multiplier, offset

    def pose(
        self, link: str, positions: Mapping[str, float], base: str | None = None
    ) -> FloatArray:
        """Return the frame of ``link`` in that of ``base``; shape (4, 4).

        Args:
            positions: of joints by name, rad or m; others are at 0.
            base: a link that carries ``link``; None: the root.
        """
        pose = np.eye(4)
        while link != (base or self.root):
            joint = self.parent_joint[link]
            pose = joint.transform(self.position(joint, positions)) @ pose
            link = joint.parent
        return pose


def rotation(axis: FloatArray, angle: float) -> FloatArray:
    """Return the matrix of a rotation about a unit vector (Rodrigues' formula); shape (3, 3)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: FloatArray = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return turned


def frame(xyz: FloatArray, rpy: FloatArray) -> FloatArray:
    """Return the frame (4, 4) of an origin: roll, pitch, yaw about fixed axes."""
    result = np.eye(4)
    roll, pitch, yaw = (rotation(axis, angle) for axis, angle in zip(np.eye(3), rpy, strict=True))
    result[:3, :3] = yaw @ pitch @ roll
    result[:3, 3] = xyz
    return result
