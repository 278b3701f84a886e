"""URDF reader: every problem at once, each with file, line and element."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from robotd.arrays import FloatArray
from robotd.descriptor.files import read_limited
from robotd.descriptor.urdf.urdf_model import (
    FIXED,
    HELD_TYPES,
    MOVING_TYPES,
    Mimic,
    UrdfJoint,
    UrdfLink,
    UrdfRobot,
    frame,
)
from robotd.descriptor.urdf.urdf_text import MAX_URDF_BYTES, is_xacro, xml_root
from robotd.descriptor.urdf.urdf_tree import check_tree, depth_first
from robotd.errors import DescriptorError, did_you_mean

_TYPES = (*MOVING_TYPES, *HELD_TYPES)
# As urdfdom reads numbers: Python also takes 1_0, and digits of other scripts.
# A digit belongs to one part only: with "\d+\.?\d*" a long text takes the square of its length.
_NUMBER = re.compile(r"\s*[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?\s*", re.ASCII | re.IGNORECASE)
IS_XACRO = (
    "is xacro, not URDF: pass it to 'robotd new-robot --urdf', which expands it, or run"
    " 'xacro FILE > NAME.urdf' and pass the result"
)
REJECTED = "RViz and MoveIt refuse the file"
# Parts of a joint that robotd does not use: urdfdom needs one of the attributes, as a number.
_UNUSED = {"dynamics": ("damping", "friction"), "safety_controller": ("k_velocity",)}
_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_urdf(path: Path) -> UrdfRobot:
    """Read and check a file. Raises DescriptorError with every problem."""
    return parse_urdf(read_limited(path, MAX_URDF_BYTES), path)


def parse_urdf(data: bytes | str, path: Path) -> UrdfRobot:
    """Parse the content of ``path``, which error texts name. Raises DescriptorError."""
    return _Reader(path).robot(xml_root(data, path))


class _Limits(NamedTuple):
    """Limits of a joint; the last five attributes of ``UrdfJoint`` before its mimic."""

    lower: float
    upper: float
    velocity: float | None
    effort: float | None
    soft: tuple[float, float] | None


WIDE_RAD = 25.0  # four turns: a joint of an arm has less, in degrees nearly each has more
WHEEL_RAD = 500.0  # without limits in effect, as exporters write wheels

_NO_LIMITS = _Limits(-math.inf, math.inf, None, None, None)
_AXIS = (1.0, 0.0, 0.0)  # of a joint without <axis>


class _Reader:
    """Reads one file; collects problems."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._problems: list[DescriptorError] = []
        self._notes: list[str] = []
        self._rejected: dict[str, list[str]] = {}  # joints by what urdfdom rejects

    def robot(self, root: Any) -> UrdfRobot:
        self._check_root(root)
        links = self._unique(root, "link", self._link)
        joints = self._unique(root, "joint", self._joint)
        for joint in joints.values():
            self._check_links(joint, links)
            self._check_mimic(joint, joints)
        if not links:
            self._problem("has no link; of macros of xacro, pass the file that uses them", root)
        if not self._problems:
            for what, line, name in check_tree(links, joints.values()):
                self._problems.append(DescriptorError(what, path=self._path, line=line, key=name))
        if self._problems:
            ordered = sorted(self._problems, key=lambda problem: problem.line or 0)
            raise DescriptorError.join(ordered)
        first, ordered_joints = depth_first(links, joints.values())
        notes = (*self._notes, *self._rejections(root))
        return UrdfRobot(root.get("name", ""), first, links, tuple(ordered_joints), notes)

    def _rejections(self, root: Any) -> Iterator[str]:
        """Yield what robotd reads and urdfdom refuses, one line for all joints with the same."""
        if not root.get("name"):
            yield f"the robot has no name: {REJECTED}"
        for what, joints in self._rejected.items():
            more = f" and {len(joints) - 1} more have" if len(joints) > 1 else " has"
            yield f"joint {joints[0]}{more} {what}: {REJECTED}"

    def _check_root(self, root: Any) -> None:
        if root.tag != "robot":
            raise self._error(f"begins with <{root.tag}>, not <robot>: no URDF", root)
        if is_xacro(root):
            raise self._error(IS_XACRO, root)

    def _unique(self, root: Any, tag: str, read: Any) -> dict[str, Any]:
        found: dict[str, Any] = {}
        lines: dict[str, int] = {}
        for element in root.findall(tag):
            name = element.get("name")
            if not name:
                self._problem(f"<{tag}> has no name", element)
                continue
            if name in lines:
                what = f"{tag} name is used before, on line {lines[name]}"
                self._problem(what, element, name)
                continue
            lines[name] = element.sourceline
            if (made := read(element, name)) is not None:
                found[name] = made
        return found

    def _link(self, element: Any, name: str) -> UrdfLink:
        return UrdfLink(
            name,
            element.sourceline,
            *self._inertial(element, name),
            self._radius(element, name),
        )

    def _inertial(self, link: Any, name: str) -> tuple[float | None, FloatArray, FloatArray]:
        """Return mass, centre and inertia of a link; without a mass where they are wrong.

        urdfdom drops an <inertial> that it cannot read, and keeps the link.
        """
        nothing = None, np.zeros(3), np.zeros((3, 3))
        if (inertial := link.find("inertial")) is None:
            return nothing
        known = len(self._problems)
        mass = self._number(inertial.find("mass"), "value", name)
        pose, tensor = self._origin(inertial, name), inertial.find("inertia")
        values = [self._number(tensor, key, name, default=0.0) or 0.0 for key in _INERTIA]
        if self._problems[known:]:
            del self._problems[known:]
            what = "has numbers that cannot be read, and is ignored"
            self._notes.append(f"link {name}: <inertial> on line {inertial.sourceline} {what}")
            return nothing
        if mass is not None and mass < 0.0:
            self._notes.append(f"link {name} has a mass below 0, which is ignored")
            mass = None
        xx, xy, xz, yy, yz, zz = values
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return mass, pose[:3, 3], pose[:3, :3] @ matrix @ pose[:3, :3].T

    def _radius(self, link: Any, name: str) -> float | None:
        for part in ("collision", "visual"):
            for shape in ("cylinder", "sphere"):
                for solid in link.findall(f"{part}/geometry/{shape}"):
                    radius = _finite(solid.get("radius", ""))
                    if radius > 0.0:
                        return radius
                    what = f"radius={solid.get('radius')!r} is not a radius: the shape is ignored"
                    self._notes.append(f"link {name}: {what}")
        return None

    def _joint(self, element: Any, name: str) -> UrdfJoint | None:
        kind = element.get("type", "")
        if kind not in _TYPES:
            what = f"type {kind!r} is unknown (available: {', '.join(_TYPES)})"
            self._problem(what, element, name)
            return None
        # What a fixed joint says about motion means nothing: exporters write zeros there.
        moves = kind in MOVING_TYPES
        if kind in ("floating", "planar"):
            self._notes.append(
                f"joint {name} is {kind}: no axis moves it, its link stays at the origin"
            )
        axis = self._axis(element, name) if moves else np.array(_AXIS)
        if not axis.any():
            self._notes.append(f"joint {name} has the axis 0 0 0: it is read as fixed")
            kind, moves, axis = FIXED, False, np.array(_AXIS)
        self._note_rejections(element, name, kind)
        limits = self._limits(element, name, kind) if moves else _NO_LIMITS
        return UrdfJoint(
            name,
            element.sourceline,
            kind,
            self._end(element, name, "parent"),
            self._end(element, name, "child"),
            self._origin(element, name),
            axis,
            *limits,
            self._mimic(element, name) if moves else None,
        )

    def _note_rejections(self, element: Any, name: str, kind: str) -> None:
        """Note what is missing or unreadable for urdfdom, and not needed here."""
        limit = element.find("limit")
        if limit is None and kind in ("revolute", "prismatic"):
            self._reject("no <limit>", name)
        for key in ("velocity", "effort"):
            if limit is not None and limit.get(key) is None:
                self._reject(f"no {key}", name)
        for tag, keys in _UNUSED.items():
            if (part := element.find(tag)) is not None:
                texts = [text for key in keys if (text := part.get(key)) is not None]
                if not texts or not all(math.isfinite(_finite(text)) for text in texts):
                    self._reject(f"a <{tag}> without {' or '.join(keys)}", name)

    def _reject(self, what: str, joint: str) -> None:
        self._rejected.setdefault(what, []).append(joint)

    def _end(self, element: Any, name: str, tag: str) -> str:
        found = element.find(tag)
        link = found.get("link") if found is not None else None
        if not link:
            self._problem(f"has no <{tag} link=...>", element, name)
        return link or ""

    def _limits(self, element: Any, name: str, kind: str) -> _Limits:
        """Return the limits: of hard and soft ones the tighter."""
        limit = element.find("limit")
        bounded = kind in ("revolute", "prismatic")
        if limit is None:
            return _NO_LIMITS
        # Exporters write 0 where they know no speed; who drives the joint asks for one.
        velocity = self._bound(limit, "velocity", name) or None
        effort = self._bound(limit, "effort", name)
        if not bounded:
            return _Limits(-math.inf, math.inf, velocity, effort, None)
        lower = self._number(limit, "lower", name, default=0.0)
        upper = self._number(limit, "upper", name, default=0.0)
        if lower is None or upper is None:
            return _Limits(-math.inf, math.inf, velocity, effort, None)
        if kind == "revolute" and WIDE_RAD < max(-lower, upper) < WHEEL_RAD:
            self._notes.append(
                f"joint {name} has the limits {lower:g} to {upper:g} rad, which are"
                f" {(upper - lower) / math.tau:.0f} turns: if they are degrees, correct the URDF"
            )
        soft = self._soft_limits(element.find("safety_controller"), name)
        if soft is None or lower >= upper:
            return _Limits(lower, upper, velocity, effort, None)
        tight = max(lower, soft[0]), min(upper, soft[1])
        if tight[0] >= tight[1]:
            what = f"soft limits {soft[0]:g} to {soft[1]:g} leave nothing of {lower:g} to {upper:g}"
            self._problem(what, element.find("safety_controller"), name)
        return _Limits(*tight, velocity, effort, soft)

    def _bound(self, limit: Any, key: str, name: str) -> float | None:
        """Return a speed or an effort; None where the file has none, as -1 says."""
        bound = self._number(limit, key, name)
        if bound is None or bound >= 0.0:
            return bound
        self._notes.append(f"joint {name}: {key}={bound:g} is below 0 and read as none")
        return None

    def _soft_limits(self, safety: Any, name: str) -> tuple[float, float] | None:
        """Return the limits of a <safety_controller>; None without them.

        A missing one is infinite. Two equal ones, as urdfdom reads two missing ones, are none.
        """
        lower = self._number(safety, "soft_lower_limit", name, default=-math.inf)
        upper = self._number(safety, "soft_upper_limit", name, default=math.inf)
        if lower is None or upper is None or lower == upper:
            return None
        return None if (lower, upper) == (-math.inf, math.inf) else (lower, upper)

    def _mimic(self, element: Any, name: str) -> Mimic | None:
        mimic = element.find("mimic")
        if mimic is None:
            return None
        multiplier = self._number(mimic, "multiplier", name, default=1.0)
        offset = self._number(mimic, "offset", name, default=0.0)
        leader = mimic.get("joint")
        if not leader:
            self._problem("<mimic> has no joint", mimic, name)
        return Mimic(leader or "", multiplier or 0.0, offset or 0.0)

    def _axis(self, element: Any, name: str) -> FloatArray:
        """Return the unit vector of the axis; zeros where it has no direction."""
        axis = self._vector(element.find("axis"), "xyz", name, _AXIS)
        length = float(np.linalg.norm(axis))
        unit: FloatArray = axis / (length or 1.0)
        return unit

    def _origin(self, element: Any, name: str) -> FloatArray:
        origin = element.find("origin")
        xyz = self._vector(origin, "xyz", name, (0.0, 0.0, 0.0))
        return frame(xyz, self._vector(origin, "rpy", name, (0.0, 0.0, 0.0)))

    def _vector(
        self, element: Any, key: str, name: str, default: tuple[float, float, float]
    ) -> FloatArray:
        text = None if element is None else element.get(key)
        if text is None:
            return np.array(default)
        values = [_finite(word) for word in text.split()]
        if len(values) != 3 or not all(map(math.isfinite, values)):
            self._problem(f"{key}={text!r} is not three finite numbers{_hint(text)}", element, name)
            return np.array(default)
        return np.array(values)

    def _number(
        self,
        element: Any,
        key: str,
        name: str,
        *,
        default: float | None = None,
    ) -> float | None:
        """Return a finite attribute; ``default`` where it is absent, None where it is wrong."""
        text = None if element is None else element.get(key)
        if text is None:
            return default
        value = _finite(text)
        if not math.isfinite(value):
            self._problem(f"{key}={text!r} is not a finite number{_hint(text)}", element, name)
        else:
            return value
        return None

    def _check_links(self, joint: UrdfJoint, links: Iterable[str]) -> None:
        for tag, link in (("parent", joint.parent), ("child", joint.child)):
            if link and link not in links:
                hint = did_you_mean(link, links)
                self._problem_at(f"{tag} link {link!r} does not exist{hint}", joint)

    def _check_mimic(self, joint: UrdfJoint, joints: dict[str, UrdfJoint]) -> None:
        seen = [joint.name]
        while (mimic := joints[seen[-1]].mimic) is not None and mimic.joint:
            if mimic.joint not in joints:
                if len(seen) == 1:  # otherwise reported at the joint that names it
                    hint = did_you_mean(mimic.joint, joints)
                    self._notes.append(
                        f"joint {joint.name} mimics joint {mimic.joint!r}, which is none{hint}:"
                        " nothing moves it"
                    )
                return
            if mimic.joint in seen:
                if mimic.joint == joint.name:
                    self._problem_at(f"mimics itself: {' → '.join([*seen, mimic.joint])}", joint)
                return
            seen.append(mimic.joint)

    def _problem(self, what: str, element: Any, name: str | None = None) -> None:
        self._problems.append(self._error(what, element, name))

    def _problem_at(self, what: str, joint: UrdfJoint) -> None:
        self._problems.append(
            DescriptorError(what, path=self._path, line=joint.line, key=joint.name)
        )

    def _error(self, what: str, element: Any, name: str | None = None) -> DescriptorError:
        line = cast("int | None", element.sourceline)
        return DescriptorError(what, path=self._path, line=line, key=name)


def _hint(text: str) -> str:
    is_xacro_value = "$(" in text or "${" in text
    return ", but a value that xacro computes: pass the xacro file" if is_xacro_value else ""


def _finite(text: str) -> float:
    """Return the number in ``text``; NaN or infinity where it is none, or too large."""
    return float(text) if _NUMBER.fullmatch(text) else math.nan
