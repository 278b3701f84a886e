"""Stream of twists: motion of the tool that a client decides while it happens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from robotd.api import FloatArray, InvalidArgument
from robotd.api.robots import JointStream
from robotd_tool_space.twist import ToolTwist, TwistStage


class ToolStream:
    """Open stream of twists, made by ``RobotTool.stream``; a context that closes it.

    Any thread, except the end of the context: a worker.

    Attributes:
        joints: open stream of all joints of the tool's group, for its end and its counts.
    """

    def __init__(self, joints: JointStream, stage: TwistStage) -> None:
        self.joints, self._stage = joints, stage

    @property
    def slow_reason(self) -> str:
        """Reason why the tool is slower than commanded; "": it is not."""
        return self._stage.status.text

    def send(self, twist: Sequence[float], *, in_tool: bool = False) -> None:
        """Move with a velocity, until the next one or the time-out; never blocks.

        Args:
            twist: x, y, z of the tool's origin in m/s, and of its rotation in rad/s.
            in_tool: along the axes of the tool, which turn with it; False: of the base.

        Raises InvalidArgument; NotReady: the stream has ended, or its client has to begin anew.
        """
        values: FloatArray = np.array(twist, np.float64)
        if values.shape != (6,) or not np.isfinite(values).all():
            raise InvalidArgument(f"twist {list(twist)} must be 6 finite numbers")
        command = ToolTwist(values, in_tool)
        self.joints.send_reference(self._stage, command, moves=bool(values.any()))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.joints.close()
