"""Plan of a new robot, understood from its URDF: roles, groups and tools, as one table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from robotd.api import DescriptorError, get_logger
from robotd.api.models import ALL_JOINTS, MAX_AXES, UrdfJoint, UrdfRobot, parse_urdf
from robotd_new_robot.answers import (
    check_joint_names,
    legal_names,
    with_answers,
    with_joint_names,
)
from robotd_new_robot.hands import tool_frame
from robotd_new_robot.joint_chains import carrier, propose_groups
from robotd_new_robot.joint_roles import Choices, Roles, assign_roles
from robotd_new_robot.srdf_file import disjoint_groups, read_srdf

log = get_logger("new-robot")
_UNITS = {"prismatic": "m"}


@dataclass(frozen=True)
class RobotPlan:
    """A URDF as it was understood.

    Attributes:
        text: of the URDF, with legal names of joints.
        path: of the URDF, for errors.
        srdf: file that named groups; None without.
        choices: answers that the URDF does not contain.
        renamed: new names of joints by the old ones.
        groups: joints by the name of their group; empty: all joints are one.
        tools: link of the tool by group, by ``ALL_JOINTS`` without groups; without those whose
            tool is the link that their last joint moves.
    """

    text: str
    path: Path
    srdf: Path | None
    choices: Choices
    urdf: UrdfRobot
    renamed: Mapping[str, str]
    roles: Roles
    groups: Mapping[str, tuple[UrdfJoint, ...]]
    tools: Mapping[str, str]

    @property
    def assumed(self) -> list[str]:
        """Names of joints whose speed is assumed."""
        return [joint.name for joint in self.roles.arm if not joint.velocity]

    @property
    def hands(self) -> dict[str, tuple[UrdfJoint, ...]]:
        """Groups that are grippers or hands."""
        fingers = [joint for hand in self.roles.hands for joint in hand.joints]
        return {name: held for name, held in self.groups.items() if held[0] in fingers}


def plan_robot(text: str, path: Path, choices: Choices, srdf: Path | None = None) -> RobotPlan:
    """Return what a URDF says, with the choices.

    Args:
        path: of the URDF, for errors.
        srdf: file that names groups and passive joints.

    Raises DescriptorError: nothing can be driven; see ``assign_roles`` and ``read_srdf``. An
    OpenQuestion where another choice is needed.
    """
    urdf = parse_urdf(text, path)
    if srdf is not None:
        named = read_srdf(srdf, urdf)
        passive = (*choices.passive, *named.passive)
        choices = replace(choices, known_groups=disjoint_groups(named.groups), passive=passive)
    renamed = legal_names(urdf)
    if renamed:
        text = with_joint_names(text, renamed, urdf.links)
        urdf, choices = parse_urdf(text, path), choices.renamed(renamed)
    check_joint_names(choices.speeds, "--speed", urdf, path)
    check_joint_names(choices.limits, "--limits", urdf, path)
    urdf = with_answers(urdf, choices.speeds, choices.limits)
    roles = assign_roles(urdf, choices, path)
    count = len(roles.arm) + (len(roles.base.joints) if roles.base else 0)
    if count == 0:
        reasons = "".join(f"; {joint.name}: {reason}" for joint, reason in roles.passive)
        raise DescriptorError(f"no joint moves: there is nothing to drive{reasons}", path=path)
    if count > MAX_AXES:
        what = (
            f"{count} joints move, the limit is {MAX_AXES}: pass --passive JOINT,... for the rest"
        )
        raise DescriptorError(what, path=path)
    hands = [hand.joints for hand in roles.hands]
    groups = propose_groups(urdf, roles.arm, hands, choices.known_groups) if choices.groups else {}
    tools = _tools(urdf, roles, groups)
    return RobotPlan(text, path, srdf, choices, urdf, renamed, roles, groups, tools)


def plan_rows(plan: RobotPlan) -> Iterator[Sequence[str]]:
    """Yield the rows of a table: joint, part, role, limits, and what tells the role."""
    roles, base = plan.roles, plan.roles.base
    yield "joint", "part", "role", "limits", "known from"
    part_of = {joint.name: name for name, held in plan.groups.items() for joint in held}
    hands = {joint.name for joint in (joint for hand in roles.hands for joint in hand.joints)}
    for axis, joint in enumerate(roles.arm):
        origin = "speed assumed" if joint.name in plan.assumed else "URDF"
        if joint.name in plan.choices.limits or joint.name in plan.choices.speeds:
            origin = "option"
        role = "finger" if joint.name in hands else "joint"
        part = part_of.get(joint.name, ALL_JOINTS)
        yield joint.name, part, f"{role}, axis {axis}", _range(joint), origin
    if base is not None:
        origin = "--wheels" if plan.choices.wheels else "axis, shape and place"
        for axis, joint in enumerate(base.joints, start=len(roles.arm)):
            side = "left" if joint in base.left else "right"
            role, speed = f"{side} wheel, axis {axis}", f"{base.velocity_rad_s:.4g} rad/s"
            yield joint.name, f"base ({base.kind})", role, speed, origin
    for joint in roles.fingers.joints if roles.fingers else ():
        yield joint.name, "gripper", "finger, by a valve", _range(joint), "URDF"
    for joint, reason in roles.passive:
        yield joint.name, "-", "no axis", "", reason
    for group, link in plan.tools.items():
        yield link, group, "tool (link)", "", "its name"


def _tools(
    urdf: UrdfRobot, roles: Roles, groups: Mapping[str, Sequence[UrdfJoint]]
) -> dict[str, str]:
    """Return the link of the tool of each group that carries no other arm."""
    fingers = [joint for hand in roles.hands for joint in hand.joints]
    arm = [joint for joint in roles.arm if joint not in fingers]
    carriers = {joint: carrier(urdf, joint, arm) for joint in arm}
    tools = {}
    for name, joints in (groups or {ALL_JOINTS: roles.arm}).items():
        held = [joint for joint in joints if joint in arm]
        if not held or held[-1] in carriers.values():
            continue
        if (link := tool_frame(urdf, held[-1])) is not None:
            tools[name] = link
    return tools


def _range(joint: UrdfJoint) -> str:
    unit = _UNITS.get(joint.type, "rad")
    if joint.type == "continuous":
        return "endless"
    return f"{joint.lower:.4g} to {joint.upper:.4g} {unit}"
