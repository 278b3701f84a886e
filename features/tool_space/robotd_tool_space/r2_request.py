"""Requests of the service ``wmx/robot/start_motion``."""

from __future__ import annotations

from typing import Any

from robotd.api import FloatArray, InvalidArgument
from robotd_tool_space.r2_units import joints_of_r2, pose_of_r2, r2_factors
from robotd_tool_space.robot_tool import BASE, TOOL, RobotTool
from robotd_tool_space.tool_motion import ToolMotion

CHOICES = ("mode", "frame", "target_type", "path")  # fields that are 0 or 1
RELATIVE, JOINTS, LINE = 1, 0, 1  # of mode, target_type and path
POSTURE = ("s", "e", "r")


def planned(tool: RobotTool, request: Any) -> ToolMotion:
    """Return the motion that a request asks for.

    Raises InvalidArgument, Unreachable; NotReady: the joints move.
    """
    for field in CHOICES:
        if (value := getattr(request, field)) not in (0, 1):
            raise InvalidArgument(f"{field} is {value}, must be 0 or 1")
    if request.target_type == JOINTS:
        if request.path == LINE:
            raise InvalidArgument("a line (path 1) needs a pose (target_type 1), not joints")
        return tool.plan_joints(_joint_target(tool, request))
    pose = pose_of_r2(request.target_pose)
    if request.mode == RELATIVE:
        pose = tool.relative(pose, TOOL if request.frame else BASE)
    if request.path == LINE:
        return tool.plan_lines([pose])
    for field in POSTURE:
        if value := getattr(request, field):
            text = f"{field} is {value}, must be 0: of the postures that of the shortest way is"
            raise InvalidArgument(f"{text} taken; name another one by its joints (target_type 0)")
    return tool.plan_move(pose)


def _joint_target(tool: RobotTool, request: Any) -> FloatArray:
    factors = r2_factors(tool.kinematics.units)
    target = joints_of_r2(request.target_joint, tool.group.joint_names, factors)
    return tool.start() + target if request.mode == RELATIVE else target
