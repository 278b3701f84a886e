"""Pose of the tool that is kept with the joints of a taught pose, and whether it still holds."""

from __future__ import annotations

import numpy as np

from robotd.api import DescriptorError, FloatArray, InvalidArgument, Unsupported
from robotd.api.robots import JointGroup, Robot
from robotd_shared.pose_file import SavedToolPose
from robotd_tool_space.geometry.rotations import (
    COMPONENTS,
    inverse_pose,
    pose_differences,
    pose_of,
    rpy_of,
)
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.tool_groups import ToolGroups

MAX_SHIFT_M, MAX_TURN_RAD = 1e-3, 0.01  # of a tool that counts as the same


def tool_of(robot: Robot, group: JointGroup) -> RobotTool | None:
    """Return the tool of a joint group; None: it has no kinematics."""
    try:
        return robot.feature(ToolGroups).of(group.name)
    except (DescriptorError, Unsupported, InvalidArgument):
        return None


def tool_pose_at(robot: Robot, group: JointGroup, positions: FloatArray) -> SavedToolPose | None:
    """Return the pose of the chosen tool in the chosen work frame at positions (n,).

    None: no kinematics, or a tool or work frame that is not in the robot's file.
    """
    tool = tool_of(robot, group)
    if tool is None or not tool.are_of_file:
        return None
    pose = _pose(tool, tool.tool_name, tool.work_frame_name, positions)
    numbers = map(float, [*pose[:3, 3], *rpy_of(pose)])
    components = dict(zip(COMPONENTS, numbers, strict=True))
    return SavedToolPose(tool=tool.tool_name, work_frame=tool.work_frame_name, **components)


def tool_change(
    robot: Robot, group: JointGroup, positions: FloatArray, saved: SavedToolPose
) -> str:
    """Return how far the tool would be from where it was saved; "": it is the same.

    ``positions``: (n,) of the joints, saved with it.
    """
    tool = tool_of(robot, group)
    if tool is None:
        return ""
    try:
        pose = _pose(tool, saved.tool, saved.work_frame, positions)
    except InvalidArgument as error:
        return str(error)
    difference = pose_differences(pose, matrix_of(saved))
    shift, turn = (float(np.linalg.norm(part)) for part in (difference[:3], difference[3:]))
    if shift <= MAX_SHIFT_M and turn <= MAX_TURN_RAD:
        return ""
    return (
        f"{saved.tool or 'the tool'} would be {1e3 * shift:.1f} mm and {turn:.3f} rad from where it"
        f" was saved, at most {1e3 * MAX_SHIFT_M:g} mm and {MAX_TURN_RAD:g} rad: tool, work frame"
        " or arm has changed; save the pose anew, or remove it from tool_poses in the file"
    )


def matrix_of(saved: SavedToolPose) -> FloatArray:
    """Return a saved pose as a matrix (4, 4)."""
    components = [getattr(saved, name) for name in COMPONENTS]
    return pose_of(components[:3], components[3:])


def _pose(tool: RobotTool, name: str, work_frame: str, positions: FloatArray) -> FloatArray:
    """Return the pose of a tool in a work frame. Raises InvalidArgument: unknown name."""
    kinematics = tool.kinematics_of(name)
    return inverse_pose(tool.work_frame_of(work_frame)) @ kinematics.forward(positions)
