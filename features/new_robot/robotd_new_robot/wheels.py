"""Wheels of a URDF, known by axis, shape and place, and the kind of base that they make."""

from __future__ import annotations

import math
import re
from collections.abc import Container, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from robotd.api import FloatArray
from robotd.api.models import UrdfJoint, UrdfRobot
from robotd_new_robot.joint_chains import carrier

# A caster; a suspension, which a drive would hold against the springs.
_PASSIVE = re.compile(r"cast[eo]r|idler|rocker|bogie|suspension|wheel_?drop", re.IGNORECASE)
_FREE = re.compile(r"swivel|roller", re.IGNORECASE)  # without limits; else an axis of a machine
_WHEEL = re.compile(r"wheel", re.IGNORECASE)
_STEERING = re.compile(r"steer", re.IGNORECASE)  # exporters write its axis wrongly, as 0 0 1
_SIDEWAYS = re.compile(r"mecanum|omni", re.IGNORECASE)
UPRIGHT = 0.9  # part of an axis along z
LEVEL = 0.2
ENDLESS_RAD = 1e3  # range of a wheel that an exporter writes as revolute
SAME_PLACE_M = 0.02  # by which drawings miss a common axle or ground
GROUND_SHARE = 0.3  # of the radius
MIN_TRACK_M = 0.05
DISC = 1.2  # least ratio of a wheel's moments of inertia, about its axis and across: a disc has 2
ROUND = 0.05  # part by which the two moments across may differ


class BaseKind(StrEnum):
    """Kind of a base by its wheels."""

    DIFFERENTIAL = "differential"
    SKID_STEER = "skid_steer"
    MECANUM = "mecanum"
    FOUR_WHEELS = "four_wheels"  # one of the last two: drawings seldom show the rollers
    TRICYCLE = "tricycle"
    ACKERMANN = "ackermann"
    STEERED = "steered"  # each wheel
    OMNI = "omni"
    OTHER = "other"


@dataclass(frozen=True, eq=False)
class Wheel:
    """A wheel of the base.

    Attributes:
        steering: joint that turns it about the vertical; None without.
        center: in the frame of the root, m; shape (3,).
        axis: unit vector in the frame of the root; shape (3,).
        radius_m: of its cylinder or sphere, else of a disc of its inertia; None unknown.
    """

    joint: UrdfJoint
    steering: UrdfJoint | None
    center: FloatArray
    axis: FloatArray
    radius_m: float | None

    @property
    def bottom(self) -> float:
        """Height of its lowest point in the frame of the root, m."""
        return float(self.center[2]) - (self.radius_m or 0.0)


def is_passive(joint: UrdfJoint) -> bool:
    """Return True for a caster, a suspension or a free roller, by its name."""
    is_free = joint.type == "continuous" and _FREE.search(joint.name)
    return bool(_PASSIVE.search(joint.name) or is_free)


def find_wheels(urdf: UrdfRobot, passive: Container[str] = ()) -> list[Wheel]:
    """Return the wheels on the ground, in the order of the tree.

    A wheel turns without end about a level axis, and the base carries it, with or without a
    steering joint. If it is not called a wheel, it is a round body that is steered or has a twin.

    Args:
        passive: names of joints that are not wheels.
    """
    wheels = [
        wheel
        for joint in urdf.joints
        if joint.name not in passive and (wheel := _wheel(urdf, joint)) is not None
    ]
    known = [w for w in wheels if is_named_wheel(w.joint) or _is_round(urdf, w)]
    found = [w for w in known if is_named_wheel(w.joint) or w.steering or _has_twin(w, known)]
    ground = min((wheel.bottom for wheel in found), default=0.0)
    return [
        wheel
        for wheel in found
        if wheel.bottom - ground < max(SAME_PLACE_M, GROUND_SHARE * (wheel.radius_m or 0.0))
    ]


def base_kind(urdf: UrdfRobot, wheels: Sequence[Wheel]) -> BaseKind:
    """Return the kind of base that the wheels make."""
    steered = [wheel for wheel in wheels if wheel.steering is not None]
    if steered:
        return _steered_kind(steered)
    if len(wheels) > 2 and any(abs(a.axis @ b.axis) < UPRIGHT for a, b in pairwise(wheels)):
        return BaseKind.OMNI
    if len(wheels) < 2 or len(wheels) % 2:
        return BaseKind.OTHER
    by_count = {2: BaseKind.DIFFERENTIAL, 4: BaseKind.FOUR_WHEELS}
    if len(wheels) == 4 and any(_has_rollers(urdf, wheel) for wheel in wheels):
        return BaseKind.MECANUM
    return by_count.get(len(wheels), BaseKind.SKID_STEER)


def _steered_kind(steered: Sequence[Wheel]) -> BaseKind:
    """Return the kind of a base with these steered wheels and perhaps others."""
    ends = [float(wheel.center[0]) for wheel in steered]
    if len(steered) == 1:
        return BaseKind.TRICYCLE
    is_one_axle = len(steered) == 2 and max(ends) - min(ends) < SAME_PLACE_M
    return BaseKind.ACKERMANN if is_one_axle else BaseKind.STEERED


def nearest_carrier(urdf: UrdfRobot, joint: UrdfJoint) -> UrdfJoint | None:
    """Return the nearest moving joint that carries ``joint``."""
    return carrier(urdf, joint, [joint for joint in urdf.joints if joint.moves])


def steering_of(urdf: UrdfRobot, wheel: UrdfJoint) -> UrdfJoint | None:
    """Return the joint of the base that turns one wheel about the vertical; None without."""
    joint = nearest_carrier(urdf, wheel)
    if joint is None or joint.type not in ("continuous", "revolute") or is_passive(joint):
        return None
    upright = abs(float(_axis(urdf, joint)[2])) > UPRIGHT
    is_steering = upright or bool(_STEERING.search(joint.name))
    is_single = len(urdf.carries(joint)) == 1 and _is_on_base(urdf, joint)
    return joint if is_steering and is_single else None


def disc_radius(urdf: UrdfRobot, joint: UrdfJoint) -> float | None:
    """Return the radius of a disc with the mass and inertia of a wheel, m; None for another body.

    A solid disc: I = ½ m r².
    """
    link = urdf.links[joint.child]
    across = np.linalg.svd(joint.axis[np.newaxis])[2][1:]  # two unit vectors
    along = float(joint.axis @ link.inertia @ joint.axis)
    first, second = sorted(np.linalg.eigvalsh(across @ link.inertia @ across.T))
    off_axis = link.center - (link.center @ joint.axis) * joint.axis
    if not link.mass or first <= 0.0 or float(np.linalg.norm(off_axis)) > SAME_PLACE_M:
        return None
    is_disc = second - first < ROUND * second and along > DISC * second
    return math.sqrt(2.0 * along / link.mass) if is_disc else None


def is_named_wheel(joint: UrdfJoint) -> bool:
    """Return True for a joint, or the link that it moves, called a wheel."""
    return bool(_WHEEL.search(joint.name) or _WHEEL.search(joint.child))


def _wheel(urdf: UrdfRobot, joint: UrdfJoint) -> Wheel | None:
    """Return ``joint`` as a wheel, by its motion; None if it cannot be one."""
    is_endless = joint.type == "revolute" and joint.upper - joint.lower > ENDLESS_RAD
    turns = joint.type == "continuous" or (is_endless and joint.has_range)
    if not turns or joint.mimic is not None or is_passive(joint):
        return None
    axis, steering = _axis(urdf, joint), steering_of(urdf, joint)
    carries = [carried for carried in urdf.carries(joint) if not _FREE.search(carried.name)]
    is_on_base = steering is not None or _is_on_base(urdf, joint)
    if carries or abs(float(axis[2])) > LEVEL or not is_on_base:
        return None
    radius = urdf.links[joint.child].radius or disc_radius(urdf, joint)
    return Wheel(joint, steering, urdf.pose(joint.child, {})[:3, 3], axis, radius)


def _is_on_base(urdf: UrdfRobot, joint: UrdfJoint) -> bool:
    """Return True if only suspensions are between the base and ``joint``."""
    below = nearest_carrier(urdf, joint)
    while below is not None and is_passive(below):
        below = nearest_carrier(urdf, below)
    return below is None


def _is_round(urdf: UrdfRobot, wheel: Wheel) -> bool:
    link = urdf.links[wheel.joint.child]
    return link.radius is not None or disc_radius(urdf, wheel.joint) is not None


def _has_twin(wheel: Wheel, wheels: Sequence[Wheel]) -> bool:
    """Return True if another wheel at its height is on the other side, or on an axle across."""
    for other in wheels:
        offset = np.abs(other.center - wheel.center)
        is_mirrored = offset[0] < SAME_PLACE_M and offset[1] > MIN_TRACK_M
        is_across = abs(float(other.axis @ wheel.axis)) < UPRIGHT
        if offset[2] < SAME_PLACE_M and (is_mirrored or is_across):
            return True
    return False


def _has_rollers(urdf: UrdfRobot, wheel: Wheel) -> bool:
    names = (wheel.joint.name, wheel.joint.child)
    return bool(urdf.carries(wheel.joint)) or any(map(_SIDEWAYS.search, names))


def _axis(urdf: UrdfRobot, joint: UrdfJoint) -> FloatArray:
    """Return the axis of a joint in the frame of the root, at position 0; shape (3,)."""
    axis: FloatArray = urdf.pose(joint.child, {})[:3, :3] @ joint.axis
    return axis
