"""Cross-check of the URDF against the descriptor."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from pathlib import Path

from robotd.descriptor import JointSettings, JointType, RobotDescriptor
from robotd.descriptor.urdf import UrdfJoint, UrdfRobot, read_urdf, read_urdf_text
from robotd.descriptor.urdf.package_files import mesh_files
from robotd.errors import DescriptorError, did_you_mean

SHOWN_MESHES = 3
ROUNDING = 1e-3  # rad, m or their rates: files are written with few digits

_LIMITS = {"lower": "lower_rad", "upper": "upper_rad", "velocity": "velocity_rad_s"}


def check_urdf(path: Path, descriptor: RobotDescriptor) -> UrdfRobot:
    """Return the URDF, checked itself and against names and limits of the joints.

    Raises DescriptorError with every problem: those of ``read_urdf``; or a joint that the URDF does
    not have or does not move, a missing ``tool_link``, and a limit of the descriptor beyond that of
    the URDF.
    """
    urdf = read_urdf(path)
    joints = urdf.joint
    problems: list[DescriptorError] = []
    for tool in descriptor.tool_links.values():
        if tool not in urdf.links:
            what = f"has no link {tool!r}, tool_link{did_you_mean(tool, urdf.links)}"
            problems.append(DescriptorError(what, path=path))
    for joint in descriptor.joints:
        problems += _differences(path, joint, joints.get(joint.name))
    fingers = descriptor.gripper.joints if descriptor.gripper else ()
    wheels = descriptor.drive.wheel_joints if descriptor.drive else ()
    for name in (*fingers, *wheels):
        if name not in joints:
            problems.append(DescriptorError(f"has no joint {name!r}", path=path))
    if problems:
        raise DescriptorError.join(problems)
    return urdf


def urdf_warnings(urdf: UrdfRobot, path: Path, descriptor: RobotDescriptor) -> Iterator[str]:
    """Yield what other readers refuse, and contradictions to the descriptor, which wins.

    A left wheel to the right of a right one: y of the base points to the left (REP 103).
    """
    yield from urdf.notes
    yield from _missing_meshes(path)
    drive = descriptor.drive
    if drive is None or not drive.wheel_joints:
        return
    y = [float(urdf.pose(urdf.joint[name].child, {})[1, 3]) for name in drive.wheel_joints]
    for left, right in product(*drive.sides):
        if y[left] < y[right]:
            yield (
                f"drive.wheel_joints: {drive.wheel_joints[left]}, a left wheel, is at y"
                f" {y[left]:g} m in the URDF, to the right of {drive.wheel_joints[right]} at"
                f" y {y[right]:g} m; the descriptor applies: if the base turns to the wrong side,"
                " exchange the axes and the wheel_joints of the two sides"
            )
            return


def _missing_meshes(path: Path) -> Iterator[str]:
    """Yield one line that counts the missing meshes and names the first ones."""
    files = mesh_files(read_urdf_text(path), path)
    missing = [name for name, file in files.items() if file is None]
    if missing:
        shown = ", ".join(missing[:SHOWN_MESHES]) + (", ..." if len(missing) > SHOWN_MESHES else "")
        yield (
            f"{len(missing)} of {len(files)} meshes not found ({shown}): the page does not draw"
            " these links; add their packages to AMENT_PREFIX_PATH, or put the files beside"
            " the URDF"
        )


def _differences(
    path: Path, joint: JointSettings, urdf: UrdfJoint | None
) -> Iterator[DescriptorError]:
    if urdf is None:
        yield DescriptorError(f"has no joint {joint.name!r}", path=path)
        return
    is_linear = urdf.type == JointType.PRISMATIC
    if not urdf.moves or is_linear != (joint.unit == "m"):
        what = f"is {urdf.type!r}, not {joint.type.value!r}"
        yield DescriptorError(what, path=path, line=urdf.line, key=joint.name)
        return
    for attribute, key in _LIMITS.items():
        theirs, ours = getattr(urdf, attribute), getattr(joint, attribute)
        if theirs is None or not math.isfinite(ours):
            continue
        if attribute != "velocity" and not urdf.has_range:
            continue
        beyond = theirs - ours if attribute == "lower" else ours - theirs
        if beyond > ROUNDING:
            soft = "soft " if urdf.soft is not None and theirs in urdf.soft else ""
            what = (
                f"{soft}{attribute} limit {theirs:g} is exceeded by {joint.key(key)} {ours:g}"
                " of the descriptor"
            )
            yield DescriptorError(what, path=path, line=urdf.line, key=joint.name)
