"""Roles of the joints of a URDF: arm, wheel, finger, or moved by nothing."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

from robotd.api import DescriptorError, UrdfJoint, UrdfRobot
from robotd_new_robot.answers import check_joint_names, check_mimics, check_ranges
from robotd_new_robot.hands import Hand, find_hands
from robotd_new_robot.wheel_base import WheelBase, find_base, wheel_base
from robotd_new_robot.wheels import (
    UPRIGHT,
    BaseKind,
    find_wheels,
    is_passive,
    nearest_carrier,
    steering_of,
)

_WHOLE_BASE = re.compile(r"root|virtual|world|dummy|planar|odom", re.IGNORECASE)
FIELD_M = 4.0  # least travel of a slide of a joint called base: a rail of an arm has less


class GripperDrive(StrEnum):
    """Actuator of a gripper."""

    OUTPUT = "output"  # a valve on one output bit
    AXIS = "axis"  # a servo drive: the fingers' leader becomes a joint of the arm
    NONE = "none"


@dataclass(frozen=True)
class Choices:
    """Answers that a URDF does not contain.

    Attributes:
        wheels: joints of the driven wheels, the left ones first; empty: found.
        kind: of a base on four wheels, which a URDF seldom shows; None: asked for.
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
    kind: BaseKind | None = None
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
        hands: grippers and hands, with or without axes.
        passive: joints without an axis, each with the reason.
    """

    arm: tuple[UrdfJoint, ...]
    base: WheelBase | None
    fingers: FingerJoints | None
    passive: tuple[tuple[UrdfJoint, str], ...]
    hands: tuple[Hand, ...] = ()


def assign_roles(urdf: UrdfRobot, choices: Choices, path: Path) -> Roles:
    """Find the role of every moving joint.

    Raises DescriptorError, with every problem and the line in ``path``: wheels that are not a pair,
    or driven joints without a range.
    """
    check_joint_names(choices.passive, "--passive", urdf, path)
    base = _base(urdf, choices, path)
    wheels = base.joints if base else ()
    free = [joint for joint in urdf.joints if joint.moves and joint not in wheels]
    passive = [(joint, "passive, as chosen") for joint in free if joint.name in choices.passive]
    passive += [
        (joint, "a passive wheel or suspension, by its name")
        for joint in free
        if is_passive(joint) and joint.name not in choices.passive
    ]
    passive += [(joint, "moves the whole base") for joint in _whole_base(urdf)]
    if base is not None:
        passive += _idle_wheels(urdf, base)
    idle = {joint.name for joint, _ in passive}
    free = [joint for joint in free if joint.name not in idle]
    check_mimics(urdf, free, path)
    groups = _finger_groups(urdf, free)
    hands = find_hands(urdf, free, [joint for group in groups for joint in group.joints])
    fingers = None
    held = {joint.name for group in groups for joint in group.joints}
    is_alone = base is None and held >= {joint.name for joint in free}
    # A gripper alone is a robot of one axis: a valve would leave nothing to drive.
    is_gripper = len(groups) == 1 and _moves_as_one(groups[0], hands)
    if choices.gripper is GripperDrive.OUTPUT and is_gripper and not is_alone:
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
    return Roles(arm, base, fingers, tuple(passive), tuple(hands))


def _base(urdf: UrdfRobot, choices: Choices, path: Path) -> WheelBase | None:
    if not choices.base:
        return None
    if not choices.wheels:
        wheels = find_wheels(urdf, choices.passive)
        return find_base(urdf, wheels, choices.kind, choices.wheel_radius_m, path)
    check_joint_names(choices.wheels, "--wheels", urdf, path)
    named = [urdf.joint[name] for name in choices.wheels]
    base = wheel_base(urdf, named, choices.kind, choices.wheel_radius_m, path)
    for wheel in base.joints:
        if (steering := steering_of(urdf, wheel)) is not None:
            what = (
                f"the wheel is steered by {steering.name}: a base with steered wheels is described"
                " by hand, as in robots/tricycle_base; --no-base makes each joint an axis"
            )
            raise DescriptorError(what, path=path, line=wheel.line, key=wheel.name)
    return base


def _whole_base(urdf: UrdfRobot) -> list[UrdfJoint]:
    """Return joints that stand for the motion of a base on the ground; no drive has them.

    They are the first ones of the tree, by their names, slide along x or y and turn about z.
    """
    found: list[UrdfJoint] = []
    for joint in urdf.joints:
        if not joint.moves:
            continue
        upright = abs(float((urdf.pose(joint.child, {})[:3, :3] @ joint.axis)[2])) > UPRIGHT
        is_plane = upright != (joint.type == "prismatic") and joint.mimic is None
        is_next = nearest_carrier(urdf, joint) is (found[-1] if found else None)
        if not (is_plane and is_next and _is_of_whole_base(urdf, joint)):
            break
        found.append(joint)
    return found if len({joint.type == "prismatic" for joint in found}) == 2 else []


def _is_of_whole_base(urdf: UrdfRobot, joint: UrdfJoint) -> bool:
    if _WHOLE_BASE.search(joint.name):
        return True
    travel = joint.upper - joint.lower
    is_wide = joint.type != "prismatic" or travel > FIELD_M
    return "base" in joint.name.lower() and is_wide and not urdf.links[joint.child].mass


def _idle_wheels(urdf: UrdfRobot, base: WheelBase) -> list[tuple[UrdfJoint, str]]:
    """Return undriven wheels of the base and what steers them, each with the reason.

    An axis would hold them in position, against the driven wheels.
    """
    found = []
    for wheel in find_wheels(urdf):
        if wheel.joint in base.joints:
            continue
        if wheel.steering is not None:
            found.append((wheel.steering, f"steers {wheel.joint.name}, which is not driven"))
        found.append((wheel.joint, "a wheel that is not driven"))
    return found


def _moves_as_one(fingers: FingerJoints, hands: Sequence[Hand]) -> bool:
    """Return True if no other joint with a range belongs to the hand of ``fingers``."""
    hand = next(hand for hand in hands if fingers.leader in hand.joints)
    others = [joint for joint in hand.joints if joint not in fingers.joints]
    return not any(joint.has_range and joint.type != "continuous" for joint in others)


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
                FingerJoints(tuple(group), tuple(_share(urdf, group[0], j) for j in group))
            )
    return found


def _share(urdf: UrdfRobot, leader: UrdfJoint, joint: UrdfJoint) -> float:
    """Return the multiple of the leader's position that a finger has; -1 for a mirrored range."""
    if joint.mimic is None and (joint.lower, joint.upper) != (leader.lower, leader.upper):
        return -1.0
    return urdf.leader(joint)[1]


def _siblings(urdf: UrdfRobot, joints: Iterable[UrdfJoint]) -> list[list[UrdfJoint]]:
    """Return pairs of prismatic joints of one link, with one stroke, that carry nothing.

    The ranges are the same, or mirrored: 0 to 0.05 and -0.05 to 0.
    """
    pairs: dict[tuple[str, float, float], list[UrdfJoint]] = {}
    for joint in joints:
        if joint.type == "prismatic" and not urdf.carries(joint):
            lower, upper = max((joint.lower, joint.upper), (-joint.upper, -joint.lower))
            pairs.setdefault((joint.parent, lower, upper), []).append(joint)
    return [pair for pair in pairs.values() if len(pair) > 1]


def _check_offsets(fingers: FingerJoints | None, path: Path) -> None:
    for joint in fingers.joints if fingers else ():
        if joint.mimic is not None and joint.mimic.offset:
            what = (
                f"a finger with a mimic offset ({joint.mimic.offset:g}) cannot be described:"
                " pass --gripper axis or none"
            )
            raise DescriptorError(what, path=path, line=joint.line, key=joint.name)
