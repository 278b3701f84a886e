"""Sequences over ROS: the action ``move_sequence``, and the service that appends to its goal."""

from __future__ import annotations

from contextlib import ExitStack
from math import inf
from typing import Any

import numpy as np
from robotd_msgs.action import MoveSequence
from robotd_msgs.msg import MotionSegment as Segment
from robotd_msgs.srv import AppendSegments

from robotd.api import InvalidArgument, NotReady, get_logger
from robotd.api.robots import Outcome, Robot, WrenchLimits
from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service
from robotd_ros.worker_action import FEEDBACK_PERIOD_NS, WorkerAction
from robotd_tool_space.geometry.rotations import fill_pose, pose_of_message
from robotd_tool_space.paths.path_outputs import PathOutput
from robotd_tool_space.paths.segments import (
    Arc,
    ArcAbout,
    JointMove,
    Line,
    SequenceStep,
    Spline,
    Wait,
)
from robotd_tool_space.robot_tool import BASE, RobotTool
from robotd_tool_space.sequences.planned_tool import Arrival
from robotd_tool_space.sequences.sequence_run import SequenceRun
from robotd_tool_space.tool_groups import ToolGroups

log = get_logger("tool")

POSES = {Segment.LINE: 1, Segment.ARC: 2, Segment.ARC_ABOUT: 1}


class MoveSequenceAction(WorkerAction):
    """Executes goals of the action. A rejected goal is aborted with its reason."""

    def __init__(self, context: NodeContext, tools: ToolGroups) -> None:
        self._robot, self._clock, self._tools = context.robot, context.robot.clock, tools
        self._runs: dict[str, SequenceRun] = {}  # under way, by group
        super().__init__(context.operator, context.host, MoveSequence, "~/move_sequence", log)
        node, host = context.operator, context.host
        add_service(node, host, AppendSegments, "~/append_segments", self._append)

    def arrived(self, goal: Any) -> tuple[RobotTool, Arrival]:
        tool = self._tools.of(goal.request.group)
        return tool, tool.arrive()

    def execute(
        self, goal: Any, result: Any, after: ExitStack, tool: RobotTool, arrival: Arrival
    ) -> tuple[Outcome, str]:
        request = goal.request
        steps = steps_of(request.segments, self._robot, tool)
        parts = tool.plan_parts(steps, constant_speed=request.constant_speed)
        run = tool.sequence(parts, arrival)
        motions = [part.motion for part in parts if part.motion is not None]
        result.duration_s = sum(motion.duration_s for motion in motions)
        result.notes = [note for motion in motions for note in motion.notes]
        if request.plan_only:
            for motion in motions[:1]:
                tool.check(motion)
            result.success = True
            result.message = f"can be executed in {result.duration_s:.2f} s; nothing moved"
            return Outcome.SUCCEEDED, result.message
        if goal.is_cancel_requested:
            result.message = "canceled while it was planned; nothing moved"
            return Outcome.CANCELED, result.message
        self.let_cancel(goal, run)
        name = tool.group.name
        if not request.constant_speed:
            self._runs[name] = run
            after.callback(lambda: self._runs.pop(name) if self._runs[name] is run else None)
        outcome, result.message = run.run(self._feedback(goal, tool, run))
        result.segment = run.progress().segment
        result.success = outcome is Outcome.SUCCEEDED
        return outcome, result.message

    def fill_failure(self, result: Any, error: Exception, text: str) -> None:
        result.message = text

    def _append(self, request: Any, response: Any) -> str:
        tool = self._tools.of(request.group)
        run = self._runs.get(tool.group.name)
        if run is None:
            raise NotReady("no goal of move_sequence runs without a constant speed: send a goal")
        steps = steps_of(request.segments, self._robot, tool, run.progress().segments)
        response.joined = run.append(steps)
        return "joined" if response.joined else "appended: the path ends at rest before"

    def _feedback(self, goal: Any, tool: RobotTool, run: SequenceRun) -> Any:
        """Return a function that publishes feedback, at most once in 40 ms."""
        message, clock = MoveSequence.Feedback(), self._clock
        due_ns = clock.now_ns()

        def publish() -> None:
            nonlocal due_ns
            if (now_ns := clock.now_ns()) < due_ns:
                return
            due_ns = now_ns + FEEDBACK_PERIOD_NS
            now = run.progress()
            message.segment, message.segments = now.segment, now.segments
            message.progress, message.waiting = now.part, now.waiting
            pose = tool.measured_pose()
            fill_pose(message.pose, np.full((4, 4), np.nan) if pose is None else pose)
            goal.publish_feedback(message)

        return publish


def steps_of(segments: Any, robot: Robot, tool: RobotTool, first: int = 0) -> list[SequenceStep]:
    """Return the steps of robotd_msgs/MotionSegment messages; ``first``: number of those before.

    Raises InvalidArgument: with the segment; Unsupported: no wrench at the tool.
    """
    steps = []
    for number, segment in enumerate(segments, first + 1):
        try:
            steps.append(_step(segment, _until(segment, robot, tool)))
        except InvalidArgument as error:
            raise InvalidArgument(f"segment {number}: {error}") from None
    return steps


def _until(message: Any, robot: Robot, tool: RobotTool) -> WrenchLimits | None:
    force_n, torque_nm, axis = message.until_force_n, message.until_torque_nm, message.until_axis
    if not (force_n or torque_nm or axis or message.until_frame or message.until_as_reported):
        return None
    if message.until_frame and not axis:
        raise InvalidArgument("until_frame belongs to until_axis")
    sensor = robot.wrenches.of(tool.group.name)
    return WrenchLimits(
        sensor,
        force_n or inf,
        torque_nm or inf,
        bias=not message.until_as_reported,
        axis=tool.wrench_axis(sensor, axis, message.until_frame or BASE) if axis else None,
    )


def _step(message: Any, until: WrenchLimits | None) -> SequenceStep:
    kind, poses = message.kind, [pose_of_message(pose) for pose in message.poses]
    if (count := POSES.get(kind)) is not None and len(poses) != count:
        raise InvalidArgument(f"{len(poses)} poses: this kind of segment has {count}")
    if kind == Segment.WAIT:
        if until is not None:
            raise InvalidArgument("a wait does not end at a contact")
        is_timed = message.time_s != 0.0
        return Wait(
            time_s=message.time_s if is_timed else None,
            input=None if is_timed else (message.input_byte, message.input_bit),
            level=message.level,
            timeout_s=message.timeout_s or None,
        )
    options: dict[str, Any] = {
        "speed": message.speed or 1.0,
        "blend_m": message.blend_m,
        "blend_rad": message.blend_rad or None,
        "until": until,
        "outputs": tuple(
            PathOutput(output.byte, output.bit, output.on, output.at_m, output.at_s)
            for output in message.outputs
        ),
    }
    if kind == Segment.JOINTS:
        if (len(poses), bool(message.positions)) not in ((1, False), (0, True)):
            raise InvalidArgument("a joint move needs either positions or one pose")
        return JointMove(poses[0] if poses else np.array(message.positions), **options)
    if kind == Segment.LINE:
        return Line(*poses, **options)
    if kind == Segment.ARC:
        return Arc(*poses, **options)
    if kind == Segment.ARC_ABOUT:
        turns = not message.fixed_orientation
        return ArcAbout(poses[0], message.angle, turns=turns, **options)
    if kind == Segment.SPLINE:
        return Spline(poses, **options)
    raise InvalidArgument(f"kind is {kind}, must be 0 to 5")
