"""Speeds of the links and the tool of an arm, which reduced speed limits."""

from __future__ import annotations

from functools import partial

import numpy as np

from robotd.api import FloatArray
from robotd.api.robots import Factors, JointGroup, ReducedSpeed, Robot
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.settings import ToolSpaceKeys
from robotd_tool_space.tool_groups import ToolGroups

PLANNED_SHARE = 0.98  # of the limit; the rest is for what happens within a period
MIN_SPEED_M_S = 1e-9  # slower counts as standing


def reduced_speed(robot: Robot) -> ReducedSpeed:
    """Return the reduced speed of a robot: ``robot.feature(reduced_speed)``.

    Limited are the origins of all moving links of the chain, of the link of the tool, and of the
    tool, in the base of the arm. It is made with a robot whose file names an input.

    Raises the errors of ``ToolGroups`` and ``ReducedSpeed``.
    """
    tools = robot.feature(ToolGroups)

    def factors(group: JointGroup, limit_m_s: float) -> Factors:
        return partial(_factors, tools.of(group.name), limit_m_s)

    settings = robot.descriptor.settings(ToolSpaceKeys).tool_space
    return ReducedSpeed(robot.groups, robot.axes, robot.io, robot.control_loop, settings, factors)


def _factors(
    tool: RobotTool, limit_m_s: float, positions: FloatArray, velocities: FloatArray
) -> FloatArray:
    """Return as ``Factors`` of ``MotionLimits``; where nothing moves it is huge."""
    points = np.stack(
        [chain_user.chain.end[:3, 3] for chain_user in (tool.at_link, tool.kinematics)]
    )
    speeds = tool.at_link.chain.speeds(positions, velocities, points).max(axis=-1)
    return PLANNED_SHARE * limit_m_s / np.maximum(speeds, MIN_SPEED_M_S)
