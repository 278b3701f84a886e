"""Action ``robotd/move_tool``: one motion of a tool at a time, to its end."""

from __future__ import annotations

from typing import Any

import numpy as np
from rclpy.action import CancelResponse, GoalResponse
from robotd_msgs.action import MoveTool

from robotd.api import InvalidArgument, RobotdError, get_logger
from robotd.api.robots import Outcome, TrajectoryExecution
from robotd_ros.middleware import worker_action_server
from robotd_ros.run_nodes import NodeContext
from robotd_tool_space.robot_tool import BASE, TOOL, RobotTool
from robotd_tool_space.ros_poses import fill_pose, pose_of_message
from robotd_tool_space.tool_groups import ToolGroups
from robotd_tool_space.tool_motion import ToolMotion

log = get_logger("tool")

FEEDBACK_PERIOD_NS = 40_000_000  # of the robot's clock
MAX_ACTIVE_GOALS = 8

_GOAL = MoveTool.Goal
_RELATIVE = {_GOAL.RELATIVE_BASE: BASE, _GOAL.RELATIVE_TOOL: TOOL}


class MoveToolAction:
    """Executes goals of the action in workers. A rejected goal is aborted with its reason."""

    def __init__(self, context: NodeContext, tools: ToolGroups) -> None:
        self._robot, self._host, self._tools = context.robot, context.host, tools
        self._executions: dict[bytes, TrajectoryExecution] = {}
        self._live = 0  # executor thread
        self._server = worker_action_server(
            context.operator,
            MoveTool,
            "~/move_tool",
            admit=self._admit,
            accepted=self._accepted,
            cancel=self._cancel,
        )

    def _admit(self, request: Any) -> GoalResponse:
        if self._live >= MAX_ACTIVE_GOALS:
            log.warning("goal rejected", reason=f"{MAX_ACTIVE_GOALS} goals have not ended yet")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _cancel(self, goal: Any) -> CancelResponse:
        if execution := self._executions.get(bytes(goal.goal_id.uuid)):
            execution.cancel()
        return CancelResponse.ACCEPT

    def _accepted(self, goal: Any) -> None:
        """Executor thread: hand the goal to a worker."""
        self._live += 1
        with self._host.callback_guard():
            try:
                tool = self._tools.of(goal.request.group)
                self._host.submit(self._run, goal, tool, tool.group.motion.ticket())
            except RobotdError as error:
                self._end(goal, None, MoveTool.Result(message=str(error)))

    def _run(self, goal: Any, tool: RobotTool, ticket: int) -> None:
        """Worker thread: plan and execute, then let the executor thread end the goal."""
        outcome, result = None, MoveTool.Result()
        try:
            with self._host.sent_by_request(goal.requester):
                outcome = self._move(goal, tool, ticket, result)
        except RobotdError as error:
            result.message = str(error)
        except Exception as error:
            log.error("a goal failed", exc_info=error)
            result.message = f"internal error: {error}"
        finally:
            self._executions.pop(bytes(goal.goal_id.uuid), None)
        self._end(goal, outcome, result)

    def _move(self, goal: Any, tool: RobotTool, ticket: int, result: Any) -> Outcome | None:
        motion = planned(tool, goal.request)
        result.duration_s, result.deviation_m = motion.duration_s, motion.deviation_m
        if goal.request.plan_only:
            tool.group.follower.check(motion.request(tool.group.joint_names))
            result.message = f"can be reached in {motion.duration_s:.2f} s; nothing moved"
            return Outcome.SUCCEEDED
        with tool.follow(motion, ticket) as execution:
            self._executions[bytes(goal.goal_id.uuid)] = execution
            self._watch(goal, tool, motion, execution)
            result.message = execution.message
            return execution.outcome

    def _watch(
        self, goal: Any, tool: RobotTool, motion: ToolMotion, execution: TrajectoryExecution
    ) -> None:
        feedback = MoveTool.Feedback()

        def report() -> None:
            passed = execution.progress().time_s / motion.duration_s
            feedback.progress = float(np.clip(passed, 0.0, 1.0))
            pose = tool.measured_pose()
            fill_pose(feedback.pose, np.full((4, 4), np.nan) if pose is None else pose)
            goal.publish_feedback(feedback)

        with execution.ticks(FEEDBACK_PERIOD_NS, self._robot.clock) as ticks:
            for _ in ticks:
                if goal.is_cancel_requested:  # before it was in the table
                    execution.cancel()
                report()
        report()  # where it has ended

    def _end(self, goal: Any, outcome: Outcome | None, result: Any) -> None:
        self._server.notify_execute(goal, lambda goal: self._finish(goal, outcome, result))

    def _finish(self, goal: Any, outcome: Outcome | None, result: Any) -> Any:
        """Executor thread."""
        self._live -= 1
        result.success = outcome is Outcome.SUCCEEDED
        if outcome is Outcome.SUCCEEDED:
            goal.succeed()
        elif outcome is Outcome.CANCELED and goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        word = outcome.name.lower() if outcome else "rejected"
        log.info("motion of the tool ended", outcome=word, reason=result.message)
        return result


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
