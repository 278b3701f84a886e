"""Stream of twists: motion of the tool that a client decides while it happens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, Self

import numpy as np

from robotd.api import FloatArray, InvalidArgument
from robotd.api.robots import JointStream
from robotd_tool_space.frames.followed_frame import FollowedFrame
from robotd_tool_space.geometry.rotations import checked_pose
from robotd_tool_space.streams.twist import PoseCommand, ToolTwist, TwistStage


class WorkFrame(Protocol):
    """Commands in the chosen work frame of a tool."""

    followed: FollowedFrame | None

    def twist_in_work_frame(self, twist: FloatArray) -> ToolTwist: ...
    def target_in_work_frame(self, pose: FloatArray) -> PoseCommand: ...


class ToolStream:
    """Open stream of twists, made by ``RobotTool.stream``; a context that closes it.

    Any thread, except the end of the context: a worker.

    Attributes:
        joints: open stream of all joints of the tool's group, for its end and its counts.
    """

    def __init__(self, joints: JointStream, stage: TwistStage, work_frame: WorkFrame) -> None:
        self.joints, self._stage, self._work_frame = joints, stage, work_frame

    @property
    def slow_reason(self) -> str:
        """Reason why the tool is slower than commanded; "": it is not."""
        followed = self._work_frame.followed
        return (followed.failure if followed else "") or self._stage.status.text

    def send(
        self, twist: Sequence[float], *, in_tool: bool = False, in_work_frame: bool = False
    ) -> None:
        """Move with a velocity, until the next one or the time-out; never blocks.

        Args:
            twist: x, y, z of the tool's origin in m/s, and of its rotation in rad/s.
            in_tool: along the axes of the tool, which turn with it; False: of the base.
            in_work_frame: along those of the chosen work frame; with a followed one, the velocity
                from it.

        Raises InvalidArgument; NotReady: the stream has ended, or its client has to begin anew.
        """
        values: FloatArray = np.array(twist, np.float64)
        if values.shape != (6,) or not np.isfinite(values).all():
            raise InvalidArgument(f"twist {list(twist)} must be 6 finite numbers")
        if in_tool and in_work_frame:
            raise InvalidArgument("a twist is in the tool or in the work frame, not in both")
        in_frame = self._work_frame.twist_in_work_frame
        command = in_frame(values) if in_work_frame else ToolTwist(values, in_tool)
        self.joints.send_reference(self._stage, command, moves=command.moves)

    def send_target(self, pose: FloatArray) -> None:
        """Move on a straight line to a pose (4, 4) in the chosen work frame, also a followed one.

        Until the next command or the time-out; errors: see ``send``.
        """
        command = self._work_frame.target_in_work_frame(checked_pose(pose))
        self.joints.send_reference(self._stage, command, moves=command.moves)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.joints.close()
