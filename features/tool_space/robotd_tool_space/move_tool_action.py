"""Action ``robotd/move_tool``: one motion of a tool at a time, to its end."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import numpy as np
from robotd_msgs.action import MoveTool

from robotd.api import InvalidArgument, get_logger
from robotd.api.robots import Outcome
from robotd_ros.run_nodes import NodeContext
from robotd_ros.worker_action import WorkerAction
from robotd_tool_space.robot_tool import BASE, TOOL, RobotTool
from robotd_tool_space.ros_poses import fill_pose, pose_of_message
from robotd_tool_space.tool_groups import ToolGroups
from robotd_tool_space.tool_motion import ToolMotion

log = get_logger("tool")

_GOAL = MoveTool.Goal
_RELATIVE = {_GOAL.RELATIVE_BASE: BASE, _GOAL.RELATIVE_TOOL: TOOL}


class MoveToolAction(WorkerAction):
    """Executes goals of the action. A rejected goal is aborted with its reason."""

    def __init__(self, context: NodeContext, tools: ToolGroups) -> None:
        self._clock, self._tools = context.robot.clock, tools
        super().__init__(context.operator, context.host, MoveTool, "~/move_tool", log)

    def arrived(self, goal: Any) -> tuple[RobotTool, int]:
        tool = self._tools.of(goal.request.group)
        return tool, tool.group.motion.ticket()

    def execute(
        self, goal: Any, result: Any, after: ExitStack, tool: RobotTool, ticket: int
    ) -> tuple[Outcome, str]:
        motion = planned(tool, goal.request)
        result.duration_s, result.deviation_m = motion.duration_s, motion.deviation_m
        if goal.request.plan_only:
            tool.group.follower.check(motion.request(tool.group.joint_names))
            result.message = f"can be reached in {motion.duration_s:.2f} s; nothing moved"
            result.success = True
            return Outcome.SUCCEEDED, result.message
        message = MoveTool.Feedback()

        def feedback() -> Any:
            passed = execution.progress().time_s / motion.duration_s
            message.progress = float(np.clip(passed, 0.0, 1.0))
            pose = tool.measured_pose()
            fill_pose(message.pose, np.full((4, 4), np.nan) if pose is None else pose)
            return message

        with tool.follow(motion, ticket) as execution:
            self.watch(goal, execution, self._clock, feedback)
            goal.publish_feedback(feedback())  # where it has ended
            outcome, result.message = execution.outcome or Outcome.FAULT, execution.message
        result.success = outcome is Outcome.SUCCEEDED
        return outcome, result.message

    def fill_failure(self, result: Any, error: Exception, text: str) -> None:
        result.message = text


def planned(tool: RobotTool, request: Any) -> ToolMotion:
    """Return the motion that a goal asks for. Raises Unreachable, InvalidArgument, NotReady."""
    speed = request.speed or 1.0
    poses = [pose_of_message(each) for each in request.poses]
    if request.frame in _RELATIVE:
        poses = [tool.relative(each, _RELATIVE[request.frame]) for each in poses]
    elif request.frame != _GOAL.BASE:
        raise InvalidArgument(f"frame is {request.frame}, must be 0, 1 or 2")
    if request.line:
        return tool.plan_lines(poses, speed, request.blend_m)
    if len(poses) != 1:
        raise InvalidArgument(f"{len(poses)} poses: without `line` a goal has exactly one")
    return tool.plan_move(poses[0], speed)
