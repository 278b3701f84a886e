"""Services and the action of tool space, which need the interfaces ``robotd_msgs``."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import numpy as np
from robotd_msgs.action import MoveTool
from robotd_msgs.srv import ComputeFk, ComputeIk, SelectFrame
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from robotd.api import FloatArray, InvalidArgument, get_logger
from robotd.api.robots import Outcome
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.qos import LATCHED
from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service
from robotd_ros.worker_action import WorkerAction
from robotd_tool_space.geometry.rotations import fill_pose, inverse_pose, pose_of_message
from robotd_tool_space.link_speeds import reduced_speed
from robotd_tool_space.paths.tool_motion import ToolMotion
from robotd_tool_space.robot_tool import BASE, TOOL, RobotTool
from robotd_tool_space.sequences.planned_tool import Arrival
from robotd_tool_space.tool_groups import ToolGroups

log = get_logger("tool")

_GOAL = MoveTool.Goal
_RELATIVE = {_GOAL.RELATIVE_BASE: BASE, _GOAL.RELATIVE_TOOL: TOOL}


class ToolServices:
    """Services of the tool: ``compute_ik``, ``set_tool``, ``set_reduced_speed`` and others."""

    def __init__(self, context: NodeContext, tools: ToolGroups) -> None:
        self._tools = tools
        self._robot = context.robot
        node, host = context.operator, context.host
        add_service(node, host, ComputeIk, "~/compute_ik", self._compute_ik)
        add_service(node, host, ComputeFk, "~/compute_fk", self._compute_fk)
        add_service(node, host, SelectFrame, "~/set_tool", self._set_tool)
        add_service(node, host, SelectFrame, "~/set_work_frame", self._set_work_frame)
        add_service(node, host, SetBool, "~/set_reduced_speed", self._set_reduced_speed)
        reduced = node.create_publisher(Bool, "~/reduced_speed", LATCHED)
        self._reduced_speed = context.robot.feature(reduced_speed)
        self._reduced_speed.on_change(lambda on: publish_if_alive(reduced, Bool(data=on)))

    def _compute_ik(self, request: Any, response: Any) -> str:
        tool = self._tools.of(request.group)
        check_frame(tool, request.pose_stamped.header.frame_id)
        target = tool.work_frame @ pose_of_message(request.pose_stamped.pose)
        seed = self._positions(tool, request.seed)
        kinematics = tool.kinematics
        found = (
            kinematics.solutions(target, seed)
            if request.all
            else [kinematics.inverse(target, seed)]
        )
        response.solutions = [
            JointState(name=list(kinematics.chain.names), position=solution.tolist())
            for solution in found
        ]
        return f"{len(found)} solution{'s' if len(found) != 1 else ''}"

    def _compute_fk(self, request: Any, response: Any) -> str:
        tool = self._tools.of(request.group)
        if tool.followed is not None:
            tool.followed.require()
        pose = tool.kinematics.forward(self._positions(tool, request.joint_state))
        fill_pose(response.pose_stamped.pose, inverse_pose(tool.work_frame) @ pose)
        response.pose_stamped.header.frame_id = tool.work_frame_name or tool.base
        return tool.tool_name or tool.link

    def _positions(self, tool: RobotTool, message: Any) -> FloatArray:
        """Return the positions of a JointState; those that it lacks are where the joints are."""
        names = tool.kinematics.chain.names
        if len(message.name) != len(message.position):
            text = f"{len(message.name)} names and {len(message.position)} positions"
            raise InvalidArgument(f"the joint state has {text}")
        given = dict(zip(message.name, message.position, strict=True))
        for name in given:
            if name not in names:
                raise InvalidArgument(f"joint {name!r} is none of {', '.join(names)}")
        here = self._robot.image.copy().position[list(tool.group.joint_axes)]
        values = [given.get(name, float(now)) for name, now in zip(names, here, strict=True)]
        positions = np.array(values)
        if not np.isfinite(positions).all():
            raise InvalidArgument("a position of the joints is not known, or not finite")
        return positions

    def _set_tool(self, request: Any, response: Any) -> str:
        tool = self._tools.of(request.group)
        tool.select_tool(request.name)
        return f"tool {request.name or tool.link}"

    def _set_work_frame(self, request: Any, response: Any) -> str:
        tool = self._tools.of(request.group)
        tool.select_work_frame(request.name)
        return f"work frame {request.name or tool.base}"

    def _set_reduced_speed(self, request: Any, response: Any) -> str:
        self._reduced_speed.set(request.data)
        return self._reduced_speed.text


def check_frame(tool: RobotTool, frame_id: str) -> None:
    """Raise InvalidArgument for poses in another frame than the work frame, or the base."""
    known = tool.work_frame_name or tool.base
    if frame_id not in ("", known):
        raise InvalidArgument(f"frame {frame_id!r}: poses are in {known!r}; choose a work frame")


class MoveToolAction(WorkerAction):
    """Executes goals of the action. A rejected goal is aborted with its reason."""

    def __init__(self, context: NodeContext, tools: ToolGroups) -> None:
        self._clock, self._tools = context.robot.clock, tools
        super().__init__(context.operator, context.host, MoveTool, "~/move_tool", log)

    def arrived(self, goal: Any) -> tuple[RobotTool, Arrival]:
        tool = self._tools.of(goal.request.group)
        return tool, tool.arrive()

    def execute(
        self, goal: Any, result: Any, after: ExitStack, tool: RobotTool, arrival: Arrival
    ) -> tuple[Outcome, str]:
        motion = planned(tool, goal.request)
        if goal.is_cancel_requested:
            result.message = "canceled while it was planned; nothing moved"
            return Outcome.CANCELED, result.message
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

        with tool.follow(motion, arrival) as execution:
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
    poses = [pose_of_message(pose) for pose in request.poses]
    if request.frame in _RELATIVE:
        poses = [tool.relative(pose, _RELATIVE[request.frame]) for pose in poses]
    elif request.frame != _GOAL.BASE:
        raise InvalidArgument(f"frame is {request.frame}, must be 0, 1 or 2")
    if request.line:
        return tool.plan_lines(poses, speed, request.blend_m)
    if len(poses) != 1:
        raise InvalidArgument(f"{len(poses)} poses: without `line` a goal has exactly one")
    return tool.plan_move(poses[0], speed)
