"""Answers to what a URDF leaves open: speeds, limits and names of joints."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from robotd.api import DescriptorError, did_you_mean
from robotd.api.models import NAME, UrdfJoint, UrdfRobot

ASSUMED_SPEED = {"prismatic": 0.05}  # m/s
ASSUMED_SPEED_RAD_S = 0.5
MAX_SPEED = 1e4  # rad/s or m/s; exporters write 1e8 or 1e308 for "none"
ALL = ""  # key of an answer for every joint without its own
LIMITED = ("revolute", "prismatic")


def with_answers(
    urdf: UrdfRobot,
    speeds: Mapping[str, float],
    limits: Mapping[str, tuple[float, float]],
) -> UrdfRobot:
    """Return the robot with the speeds and limits; without speeds that are placeholders."""
    joints = []
    for joint in urdf.joints:
        own = None if (joint.velocity or 0.0) > MAX_SPEED else joint.velocity
        speed = speeds.get(joint.name, own or speeds.get(ALL))
        needs = joint.type in LIMITED and not joint.has_range
        given = limits.get(joint.name, limits.get(ALL) if needs else None)
        lower, upper = given or (joint.lower, joint.upper)
        kind = "revolute" if given and joint.type == "continuous" else joint.type
        joints.append(replace(joint, type=kind, lower=lower, upper=upper, velocity=speed))
    return replace(urdf, joints=tuple(joints))


def with_assumed_speeds(joints: Iterable[UrdfJoint]) -> tuple[UrdfJoint, ...]:
    """Return the joints; those without a speed get a slow one."""
    return tuple(
        joint
        if joint.velocity
        else replace(joint, velocity=ASSUMED_SPEED.get(joint.type, ASSUMED_SPEED_RAD_S))
        for joint in joints
    )


def check_joint_names(names: Iterable[str], option: str, urdf: UrdfRobot, path: Path) -> None:
    """Raise DescriptorError for a name of ``option`` that is not a joint of the robot."""
    for name in names:
        if name not in urdf.joint and name != ALL:
            what = f"has no joint {name!r} for {option}{did_you_mean(name, urdf.joint)}"
            raise DescriptorError(what, path=path)


def check_ranges(joints: Sequence[UrdfJoint], path: Path) -> None:
    """Raise DescriptorError where driven joints have no limits, or limits without a range."""
    without = [joint for joint in joints if joint.type in LIMITED and not joint.has_range]
    if not without:
        return
    names = ",".join(joint.name for joint in without)
    answers = (
        f"pass --limits LOWER,UPPER (one joint: --limits {without[0].name}=LOWER,UPPER), or"
        f" --passive {names} for joints that no drive moves"
    )
    problems = []
    for joint in without:
        what = f"lower limit {joint.lower:g} is not below upper {joint.upper:g}"
        if math.isinf(joint.lower):
            what = "has no limits"
        problems.append(DescriptorError(what, path=path, line=joint.line, key=joint.name))
    raise DescriptorError.join([*problems, DescriptorError(answers, path=path)])


def check_mimics(urdf: UrdfRobot, joints: Iterable[UrdfJoint], path: Path) -> None:
    """Raise DescriptorError for joints that mimic one that does not exist."""
    lost = [joint for joint in joints if joint.mimic and joint.mimic.joint not in urdf.joint]
    problems = []
    for joint in lost:
        leader = joint.mimic.joint if joint.mimic else ""
        what = f"mimics joint {leader!r}, which is none{did_you_mean(leader, urdf.joint)}"
        problems.append(DescriptorError(what, path=path, line=joint.line, key=joint.name))
    if problems:
        names = ",".join(joint.name for joint in lost)
        what = f"correct the URDF, or pass --passive {names}"
        raise DescriptorError.join([*problems, DescriptorError(what, path=path)])


def legal_names(urdf: UrdfRobot) -> dict[str, str]:
    """Return names that descriptors and ROS allow for the moving joints that need one."""
    taken = {joint.name for joint in urdf.joints}
    renamed: dict[str, str] = {}
    for joint in urdf.joints:
        if not joint.moves or NAME.fullmatch(joint.name):
            continue
        plain = legal_name(joint.name, "joint")
        name, number = plain, 2
        while name in taken:
            name, number = f"{plain}_{number}", number + 1
        taken.add(name)
        renamed[joint.name] = name
    return renamed


def legal_name(name: str, kind: str) -> str:
    """Return a name that descriptors and ROS allow; it begins with ``kind`` if need be."""
    plain = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_")
    return plain if plain[:1].isalpha() else f"{kind}_{plain}".rstrip("_")


def with_joint_names(text: str, renamed: Mapping[str, str], links: Iterable[str]) -> str:
    """Return the text of a URDF with other names of joints; links, the frames, keep theirs.

    ``<gazebo reference=...>`` means a link where one has the name.
    """
    links = set(links)

    def tag(match: re.Match[str]) -> str:
        def attribute(found: re.Match[str]) -> str:
            head, quote, written = found.groups()
            name = html.unescape(written)
            is_link = head.startswith("reference") and name in links
            return f"{head}{quote}{written if is_link else renamed.get(name, written)}{quote}"

        return re.sub(r"""\b((?:name|joint|reference)\s*=\s*)(["'])(.*?)\2""", attribute, match[0])

    return re.sub(r"""<(?:joint|mimic|gazebo)\b(?:"[^"]*"|'[^']*'|[^>"'])*>""", tag, text)
