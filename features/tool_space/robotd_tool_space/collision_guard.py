"""Keeps the arms of a robot from collisions, where its file asks for it. No safety function."""

from __future__ import annotations

import numpy as np

from robotd.api import NANOSECONDS, FloatArray, ProcessImage, get_logger
from robotd.api.robots import Robot
from robotd_tool_space.collisions import Collisions
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.settings import ToolSpaceKeys
from robotd_tool_space.tool_groups import ToolGroups

log = get_logger("tool")

SILENT_NS = NANOSECONDS  # without an obstacle, after which the next one is noted
REACTION_PERIODS = 3  # until the device has begun to stop


class CollisionGuard:
    """Checks of all motion of the arms of a robot; none where the key ``collisions`` is null.

    Trajectories are checked whole and rejected, streams, moves and jogs are stopped in time.

    Raises Unsupported, DescriptorError: a joint group has no usable chain, or the URDF no usable
    shapes.
    """

    def __init__(self, robot: Robot) -> None:
        settings = robot.descriptor.settings(ToolSpaceKeys).tool_space.collisions
        if settings is None:
            return
        tools: ToolGroups = robot.attribute("tool_groups")
        guards = []
        for name, group in robot.groups.items():
            if group.joint_names:
                tool = tools.of(name)
                collisions = Collisions.of(robot.descriptor, tool.at_link, settings)
                guards.append(_GroupGuard(robot, tool, collisions))

        def look(image: ProcessImage) -> None:
            for each in guards:
                each.look(image)

        robot.control_loop.every(robot.descriptor.cycle.rate_hz, "collisions", look)


class _GroupGuard:
    """Of one joint group. Control loop."""

    def __init__(self, robot: Robot, tool: RobotTool, collisions: Collisions) -> None:
        self._axes, self._tool = robot.axes, tool
        self._reaction_s = REACTION_PERIODS / robot.descriptor.cycle.rate_hz
        self._acceleration = tool.group.follower.limits.acceleration
        self._collisions, self._clock, self._met_ns = collisions, robot.clock, 0
        tool.group.motion_limits.check_path = collisions.check_path
        tool.group.motion_limits.obstacle = self.obstacle

    def obstacle(self, positions: FloatArray, stopped: FloatArray) -> str:
        """Return as ``Collisions.obstacle``; the log has it once while a client goes on."""
        reason = self._collisions.obstacle(positions, stopped)
        if reason:
            before_ns, self._met_ns = self._met_ns, self._clock.now_ns()
            if self._met_ns - before_ns > SILENT_NS:
                log.warning("motion stopped before a collision", reason=reason)
        return reason

    def look(self, image: ProcessImage) -> None:
        """Stop moves and jogs that run in the device, and would collide otherwise."""
        moved = self._tool.moved_by_device(image)
        if not moved:
            return
        chosen = list(self._tool.group.joint_axes)
        position, velocity = image.position[chosen], image.velocity[chosen]
        ramps = np.array([self._axes.deceleration[axis] for axis in chosen])
        seconds = self._reaction_s + 0.5 * np.abs(velocity) / np.minimum(ramps, self._acceleration)
        if self.obstacle(position, position + velocity * seconds):
            self._axes.stops.request(moved)
