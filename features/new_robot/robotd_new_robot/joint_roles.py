"""Roles of the joints of a URDF: arm, wheel, finger, or moved by nothing."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

from robotd.api import DescriptorError, UrdfJoint, UrdfRobot
from robotd_new_robot.answers import check_joint_names, check_mimics, check_ranges
from robotd_new_robot.joint_chains import carrier
from robotd_new_robot.wheel_base import WheelBase, left_first, wheel_base

# A caster; a suspension, which a drive would hold against the springs.
_PASSIVE = re.compile(r"cast[eo]r|idler|rocker|bogie|suspension|wheel_?drop", re.IGNORECASE)
_FREE = re.compile(r"swivel|roller", re.IGNORECASE)  # without limits; else an axis of a machine
_WHEEL = re.compile(r"wheel", re.IGNORECASE)
UPRIGHT = 0.9  # part of an axis along z
ENDLESS_RAD = 1e3  # range of a wheel that an exporter writes as revolute


class GripperDrive(StrEnum):
    """Actuator of a gripper."""

    OUTPUT = "output"  # a valve on one output bit
    AXIS = "axis"  # a servo drive: the fingers' leader becomes a joint of the arm
    NONE = "none"


@dataclass(frozen=True)
class Choices:
    """Answers that a URDF does not contain.

    Attributes:
        wheels: joints of the driven wheels, the left ones first; empty: found by name.
        wheel_radius_m: None: from the wheels' cylinders.
        base: False takes no joint for a wheel.
        gripper: actuator of the fingers.
        groups: propose joint groups where the tree has branches.
        known_groups: joints of groups that have names, none in two of them.
        ramp_s: time to full speed, from which the accelerations follow.
        speeds: of joints, rad/s or m/s; for those that have none in the URDF, or less.
        limits: lower and upper of joints, rad or m.
        passive: joints that no axis moves.
    """

    wheels: tuple[str, ...] = ()
    wheel_radius_m: float | None = None
    base: bool = True
    gripper: GripperDrive = GripperDrive.OUTPUT
    groups: bool = True
    known_groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    ramp_s: float = 0.25
    speeds: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    passive: tuple[str, ...] = ()

    def renamed(self, names: Mapping[str, str]) -> Choices:
        """Return the choices with other names of joints."""

        def key(name: str) -> str:
            return names.get(name, name)

        return replace(
            self,
            wheels=tuple(map(key, self.wheels)),
            passive=tuple(map(key, self.passive)),
            known_groups={
                name: tuple(map(key, members)) for name, members in self.known_groups.items()
            },
            speeds={key(name): speed for name, speed in self.speeds.items()},
            limits={key(name): limits for name, limits in self.limits.items()},
        )


@dataclass(frozen=True)
class FingerJoints:
    """Joints of one gripper, each a multiple of the first one's position."""

    joints: tuple[UrdfJoint, ...]
    multipliers: tuple[float, ...]

    @property
    def leader(self) -> UrdfJoint:
        """The joint whose position counts."""
        return self.joints[0]


@dataclass(frozen=True)
class Roles:
    """Roles of all moving joints.

    Attributes:
        arm: joints with an axis each, in the order of the tree.
        base: None without driven wheels.
        fingers: None without a gripper on an output bit.
        passive: joints without an axis, each with the reason.
    """

    arm: tuple[UrdfJoint, ...]
    base: WheelBase | None
    fingers: FingerJoints | None
    passive: tuple[tuple[UrdfJoint, str], ...]


def assign_roles(urdf: UrdfRobot, choices: Choices, path: Path) -> Roles:
    """Find the role of every moving joint.

    Raises DescriptorError, with every problem and the line in ``path``: wheels that are no pair, or
    driven joints without a range.
    """
    check_joint_names(choices.passive, "--passive", urdf, path)
    base = _base(urdf, choices, path)
    wheels = base.joints if base else ()
    free = [joint for joint in urdf.joints if joint.moves and joint not in wheels]
    passive = [(joint, "passive, as chosen") for joint in free if joint.name in choices.passive]
    passive += [
        (joint, "a passive wheel or suspension, by its name")
        for joint in free
        if _is_passive(joint) and joint.name not in choices.passive
    ]
    if base is not None:
        _check_steering(urdf, base, path)
        passive += _idle_wheels(urdf, free)
    idle = {joint.name for joint, _ in passive}
    free = [joint for joint in free if joint.name not in idle]
    check_mimics(urdf, free, path)
    groups = _finger_groups(urdf, free)
    fingers = None
    held = {joint.name for group in groups for joint in group.joints}
    is_alone = base is None and held >= {joint.name for joint in free}
    # A gripper alone is a robot of one axis: a valve would leave nothing to drive.
    if choices.gripper is GripperDrive.OUTPUT and len(groups) == 1 and not is_alone:
        fingers = groups[0]
        free = [joint for joint in free if joint not in fingers.joints]
    elif choices.gripper is GripperDrive.NONE:
        passive += [(joint, "a finger; --gripper none") for joint in free if joint.name in held]
        free = [joint for joint in free if joint.name not in held]
    else:  # a second gripper cannot have an output bit: their leaders become joints of the arm
        followers = {joint.name: group for group in groups for joint in group.joints[1:]}
        passive += [
            (joint, f"follows {followers[joint.name].leader.name}")
            for joint in free
            if joint.name in followers and joint.mimic is None
        ]
        free = [joint for joint in free if joint.name not in followers or joint.mimic]
    passive += [(joint, f"follows {joint.mimic.joint}") for joint in free if joint.mimic]
    arm = tuple(joint for joint in free if joint.mimic is None)
    check_ranges((*arm, *(fingers.joints[:1] if fingers else ())), path)
    _check_offsets(fingers, path)
    return Roles(arm, base, fingers, tuple(passive))


def _base(urdf: UrdfRobot, choices: Choices, path: Path) -> WheelBase | None:
    if not choices.base:
        return None
    if choices.wheels:
        check_joint_names(choices.wheels, "--wheels", urdf, path)
        named = [urdf.joint[name] for name in choices.wheels]
        return wheel_base(urdf, named, choices.wheel_radius_m, path)
    found = [
        joint
        for joint in urdf.joints
        if _is_wheel(urdf, joint) and joint.name not in choices.passive
    ]
    if not found:
        return None
    wheels = left_first(urdf, found)
    if len(found) != 2:  # which of them are driven, and how, the file does not say
        names = ",".join(joint.name for joint in wheels)
        what = (
            f"{len(found)} wheels ({names}): name the driven ones, the left ones first, by --wheels"
            f" LEFT,RIGHT or, on a skid-steer base, --wheels {names}; the others are passive then;"
            " --no-base makes each an axis of its own; mecanum and steered bases are described by"
            " hand, as in robots/mecanum_base and robots/tricycle_base"
        )
        raise DescriptorError(what, path=path, line=found[0].line, key=found[0].name)
    return wheel_base(urdf, wheels, choices.wheel_radius_m, path)


def _is_passive(joint: UrdfJoint) -> bool:
    is_free = joint.type == "continuous" and _FREE.search(joint.name)
    return bool(_PASSIVE.search(joint.name) or is_free)


def _is_wheel(urdf: UrdfRobot, joint: UrdfJoint) -> bool:
    is_endless = joint.type == "revolute" and joint.upper - joint.lower > ENDLESS_RAD
    return (
        (joint.type == "continuous" or (is_endless and joint.has_range))
        and joint.mimic is None
        and bool(_WHEEL.search(joint.name) or _WHEEL.search(joint.child))
        and not _is_passive(joint)
        and not urdf.carries(joint)
    )


def _check_steering(urdf: UrdfRobot, base: WheelBase, path: Path) -> None:
    """Raise DescriptorError for a driven wheel that is steered."""
    for wheel in base.joints:
        steering = _carrier(urdf, wheel)
        if steering is not None and _steers(urdf, steering):
            what = (
                f"the wheel is steered by {steering.name}: a base with steered wheels is described"
                " by hand, as in robots/tricycle_base; --no-base makes each joint an axis"
            )
            raise DescriptorError(what, path=path, line=wheel.line, key=wheel.name)


def _idle_wheels(urdf: UrdfRobot, free: Sequence[UrdfJoint]) -> list[tuple[UrdfJoint, str]]:
    """Return undriven wheels of the base and what steers them, each with the reason.

    An axis would hold them in position, against the driven wheels.
    """
    found = []
    for wheel in (joint for joint in free if _is_wheel(urdf, joint)):
        carrier = _carrier(urdf, wheel)
        if carrier is not None and _steers(urdf, carrier):
            found.append((carrier, f"steers {wheel.name}, which is not driven"))
        elif carrier is not None:  # beyond an arm, such as a grinding wheel
            continue
        found.append((wheel, "a wheel that is not driven"))
    return found


def _carrier(urdf: UrdfRobot, joint: UrdfJoint) -> UrdfJoint | None:
    """Return the nearest moving joint that carries ``joint``."""
    return carrier(urdf, joint, [joint for joint in urdf.joints if joint.moves])


def _steers(urdf: UrdfRobot, joint: UrdfJoint) -> bool:
    """Return True for a joint of the base that turns one wheel about the vertical."""
    upright = abs(float((urdf.pose(joint.child, {})[:3, :3] @ joint.axis)[2])) > UPRIGHT
    return (
        upright
        and joint.type in ("continuous", "revolute")
        and len(urdf.carries(joint)) == 1
        and _carrier(urdf, joint) is None
    )


def _finger_groups(urdf: UrdfRobot, joints: Sequence[UrdfJoint]) -> list[FingerJoints]:
    """Return the grippers: a leader with its mimics, or prismatic siblings, that carry nothing."""
    groups: dict[str, list[UrdfJoint]] = {}
    for joint in joints:
        groups.setdefault(urdf.leader(joint)[0].name, []).append(joint)
    mimicking = [group for group in groups.values() if len(group) > 1]
    singles = [group[0] for group in groups.values() if len(group) == 1]
    found = []
    for group in [*mimicking, *_siblings(urdf, singles)]:
        names = {joint.name for joint in group}
        carried = {carried.name for joint in group for carried in urdf.carries(joint)}
        if carried <= names:
            group.sort(key=lambda joint: joint.mimic is not None)  # the leader first
            found.append(
                FingerJoints(tuple(group), tuple(urdf.leader(joint)[1] for joint in group))
            )
    return found


def _siblings(urdf: UrdfRobot, joints: Iterable[UrdfJoint]) -> list[list[UrdfJoint]]:
    """Return pairs of prismatic joints of one link, with one stroke, that carry nothing."""
    pairs: dict[tuple[str, float, float], list[UrdfJoint]] = {}
    for joint in joints:
        if joint.type == "prismatic" and not urdf.carries(joint):
            pairs.setdefault((joint.parent, joint.lower, joint.upper), []).append(joint)
    return [pair for pair in pairs.values() if len(pair) > 1]


def _check_offsets(fingers: FingerJoints | None, path: Path) -> None:
    for joint in fingers.joints if fingers else ():
        if joint.mimic is not None and joint.mimic.offset:
            what = (
                f"a finger with a mimic offset ({joint.mimic.offset:g}) cannot be described:"
                " pass --gripper axis or none"
            )
            raise DescriptorError(what, path=path, line=joint.line, key=joint.name)
