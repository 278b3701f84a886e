"""Target of a tool: the posture that reaches it, and the move there."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from robotd.api import FloatArray, InvalidArgument, NotReady
from robotd.api.robots import Robot
from robotd_page.control_commands import Finite, Message
from robotd_page.control_tool import MAX_LINEAR_M_S, HeldToolMotion, Tools, tool_of
from robotd_page.held_motion import Heartbeat, Hold, Motion, PlannedMotion

MIN_SPEED = 0.01  # of a tool

Pose = Annotated[tuple[Finite, ...], Field(min_length=16, max_length=16)]
"""Matrix of the tool in the base of its arm, column by column; m."""


class Reach(Message):
    """Question for the posture that reaches a target; nothing moves.

    Attributes:
        id: of the answer.
        group: joint group of the tool.
        pose: target; None: where the tool is.
        is_final: the target stays: the posture in which a move ends; else any that is found
            quickly.
    """

    type: Literal["reach"]
    id: int
    group: str
    pose: Pose | None
    is_final: bool


class MoveTool(Heartbeat):
    """Heartbeat of a move to a target.

    Attributes:
        group: joint group of the tool.
        pose: target.
        line: on a straight line; else all joints move directly.
        velocity: of the tool, m/s.
    """

    type: Literal["move_tool"]
    group: str
    pose: Pose
    line: bool
    velocity: Finite


def reach(robot: Robot, tools: Tools, question: Reach) -> dict[str, Any]:
    """Return the target, and the joints that reach it or the reason why none do. Worker.

    Raises InvalidArgument: there is no such tool; NotReady: positions of joints are not known.
    """
    tool = tool_of(tools, question.group)
    kinematics, joints = tool.kinematics, tool.group.joint_axes
    measured: FloatArray = robot.image.copy().position[list(joints)]
    if not np.isfinite(measured).all():
        raise NotReady("the positions of the joints are not known")
    found: FloatArray | None = measured
    target, text = kinematics.forward(measured), ""
    if question.pose is not None:
        target = _matrix(question.pose)
        try:
            if question.is_final:  # where a move would lead: not every solution is free to go to
                pose = np.linalg.inv(tool.work_frame) @ target
                found = tool.plan_move(pose, 1.0).positions[-1]
            else:
                found = kinematics.inverse(target, measured)
        except InvalidArgument as error:
            found, text = None, str(error)
    names = tool.group.joint_names
    return {
        "pose": target.T.ravel().tolist(),
        "joints": None if found is None else dict(zip(names, found.tolist(), strict=True)),
        "text": text,
    }


class HeldMove(HeldToolMotion[MoveTool]):
    """Move of a tool by one client, which goes on while its heartbeats arrive."""

    what = "Move"

    def open(self, beat: MoveTool, hold: Hold) -> Motion:
        tool = tool_of(self._tools, beat.group)
        arrival = tool.arrive()
        pose = np.linalg.inv(tool.work_frame) @ _matrix(beat.pose)
        speed = min(beat.velocity, MAX_LINEAR_M_S) / tool.speed.velocity
        speed = min(max(speed, MIN_SPEED), 1.0)
        plan = tool.plan_lines([pose], speed) if beat.line else tool.plan_move(pose, speed)
        return PlannedMotion(tool.follow(plan, arrival), hold, lambda: self.is_silent(hold))


def _matrix(pose: Pose) -> FloatArray:
    return np.array(pose).reshape(4, 4).T
