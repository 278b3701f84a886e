"""Cross-check of the URDF against the descriptor."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import cast

from lxml import etree

from robotd.descriptor import JointSettings, JointType, RobotDescriptor
from robotd.descriptor.files import read_limited
from robotd.errors import DescriptorError

MAX_BYTES = 8_000_000
ROUNDING = 1e-3  # rad, m or their rates: files are written with few digits

_LIMITS = {"lower": "lower_rad", "upper": "upper_rad", "velocity": "velocity_rad_s"}


def check_urdf(path: Path, descriptor: RobotDescriptor) -> None:
    """Compare names and limits of the joints.

    Raises DescriptorError with every difference: a joint that the URDF does not have or does
    not move, and a limit of the descriptor beyond that of the URDF.
    """
    joints = {joint.get("name"): joint for joint in _parse(path).iter("joint")}
    problems: list[DescriptorError] = []
    for joint in descriptor.joints:
        problems += _differences(path, joint, joints.get(joint.name))
    for name in descriptor.gripper.joints if descriptor.gripper else ():
        if name not in joints:
            problems.append(DescriptorError(f"has no joint {name!r}", path=path))
    if problems:
        raise DescriptorError.join(problems)


def _parse(path: Path) -> etree._Element:
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    try:
        return etree.fromstring(read_limited(path, MAX_BYTES), parser)
    except etree.XMLSyntaxError as error:
        raise DescriptorError(f"not XML: {error.msg}", path=path, line=error.lineno) from None


def _differences(
    path: Path, joint: JointSettings, element: etree._Element | None
) -> Iterator[DescriptorError]:
    if element is None:
        yield DescriptorError(f"has no joint {joint.name!r}", path=path)
        return
    line = cast("int | None", element.sourceline)
    is_linear = element.get("type") == JointType.PRISMATIC
    if element.get("type") not in set(JointType) or is_linear != (joint.unit == "m"):
        what = f"is {element.get('type')!r}, not {joint.type.value!r}"
        yield DescriptorError(what, path=path, line=line, key=joint.name)
        return
    limit = element.find("limit")
    if limit is None:
        return
    for attribute, key in _LIMITS.items():
        theirs, ours = _number(limit.get(attribute)), getattr(joint, attribute)
        beyond = theirs - ours if attribute == "lower" else ours - theirs
        if beyond > ROUNDING and math.isfinite(ours):  # never with NaN
            what = (
                f"{attribute} limit {theirs:g} is exceeded by {joint.key(key)} {ours:g}"
                " of the descriptor"
            )
            yield DescriptorError(what, path=path, line=line, key=joint.name)


def _number(text: str | None) -> float:
    """Parse a number; NaN where the file has none."""
    try:
        return float(text) if text is not None else math.nan
    except ValueError:
        return math.nan
