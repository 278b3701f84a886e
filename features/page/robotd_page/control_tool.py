"""Hold-to-run jog of a tool: it moves in one direction while heartbeats of its button arrive."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from typing import Any, Literal, Protocol, TypeVar

import numpy as np

from robotd.api import FloatArray, InvalidArgument, unknown_name
from robotd.api.features import logged_command
from robotd.api.robots import JointGroup, JointStream, Robot, TrajectoryExecution
from robotd_page.control_commands import Finite
from robotd_page.control_jog import jog_velocities, require_stoppable
from robotd_page.held_motion import (
    TIMEOUT_S,
    Heartbeat,
    HeldMotion,
    Hold,
    JogEnd,
    StreamedMotion,
)

MAX_LINEAR_M_S = 0.1
MAX_ANGULAR_RAD_S = 0.2

Direction = tuple[Finite, Finite, Finite]


class AnyToolStream(Protocol):
    """Open stream of velocities of a tool."""

    joints: JointStream

    @property
    def slow_reason(self) -> str:
        """Reason why the tool is slower than commanded; "": it is not."""

    def send(self, twist: Sequence[float], *, in_tool: bool = False) -> None:
        """Move with x, y, z in m/s and rad/s, in the axes of the base or of the tool."""


class AnyKinematics(Protocol):
    """Kinematics of a tool in the base of its arm, as ``robotd_tool_space.Kinematics``."""

    def forward(self, positions: FloatArray) -> FloatArray: ...
    def inverse(self, target: FloatArray, seed: FloatArray) -> FloatArray: ...


class AnyToolSpeed(Protocol):
    """Speed of a tool in m/s, of the robot's file."""

    @property
    def velocity(self) -> float: ...


class Tool(Protocol):
    """Tool of a joint group, as another feature offers it: ``robotd_tool_space.RobotTool``."""

    group: JointGroup

    @property
    def kinematics(self) -> AnyKinematics: ...
    @property
    def work_frame(self) -> FloatArray: ...
    @property
    def speed(self) -> AnyToolSpeed: ...

    @property
    def base(self) -> str:
        """Link of the base."""

    @property
    def link(self) -> str:
        """Link that the tools are fixed to."""

    def stream(self, **options: Any) -> AnyToolStream:
        """Open a stream; ``options`` are those of ``JointStreams``."""

    def plan_move(self, pose: FloatArray, speed: float) -> Any: ...
    def plan_lines(self, poses: Sequence[FloatArray], speed: float) -> Any: ...
    def arrive(self) -> Any: ...
    def follow(self, motion: Any, arrival: Any) -> AbstractContextManager[TrajectoryExecution]: ...


Tools = Mapping[str, Tool]
"""Tools of a robot by joint group; empty where there are none, or nothing moves them."""


def tool_of(tools: Tools, group: str) -> Tool:
    """Return the tool of a group. Raises InvalidArgument."""
    if group not in tools:
        raise InvalidArgument(unknown_name("tool of group", group, tools))
    return tools[group]


def describe_tools(tools: Tools) -> list[dict[str, Any]]:
    """Return what a page needs to jog each tool; velocities in m/s and rad/s."""
    return [
        {
            "group": name,
            "link": tool.link,
            "base": tool.base,
            "axes": [*tool.group.joint_axes],
            "linear": MAX_LINEAR_M_S,
            "angular": MAX_ANGULAR_RAD_S,
        }
        for name, tool in tools.items()
    ]


class JogTool(Heartbeat):
    """Heartbeat of a direction of a tool that is held.

    Attributes:
        group: joint group of the tool.
        frame: the axes of the base, or of the tool, which turn with it.
        linear: m/s along x, y, z.
        angular: rad/s about x, y, z.
    """

    type: Literal["jog_tool"]
    group: str
    frame: Literal["base", "tool"]
    linear: Direction
    angular: Direction


Beat = TypeVar("Beat", bound=Heartbeat)


class HeldToolMotion(HeldMotion[Beat]):
    """Hold-to-run motion of tools; arguments as of ``HeldMotion``."""

    def __init__(
        self,
        tools: Tools,
        robot: Robot,
        owner: str,
        workers: Executor,
        ended: Callable[[JogEnd], None],
        timeout_s: float = TIMEOUT_S,
        on_note: Callable[[int, str], None] = lambda hold, note: None,
    ) -> None:
        super().__init__(robot, owner, workers, ended, timeout_s, on_note)
        self._tools = tools


class HeldTool(HeldToolMotion[JogTool]):
    """Jog of tools by one client.

    Every joint keeps below its jog velocity; where that does not suffice the tool slows down and
    keeps its direction.
    """

    def open(self, beat: JogTool, hold: Hold) -> StreamedMotion:
        return self.jog_tool(beat.group, beat.frame, *beat.linear, *beat.angular)

    @logged_command
    def jog_tool(
        self,
        group: str,
        frame: str,
        x: float,
        y: float,
        z: float,
        roll: float,
        pitch: float,
        yaw: float,
    ) -> StreamedMotion:
        """Open the stream of a tool. Raises RobotdError with the reason of a rejection."""
        tool = tool_of(self._tools, group)
        linear = _slowed([x, y, z], MAX_LINEAR_M_S)
        twist = np.concatenate([linear, _slowed([roll, pitch, yaw], MAX_ANGULAR_RAD_S)])
        if not twist.any():
            raise InvalidArgument("the jog velocity of the tool is 0")
        streams, names = tool.group.stream, tool.group.joint_names
        velocities = jog_velocities(self._robot)
        highest = [velocities[name] for name in names]
        for name, velocity in zip(names, highest, strict=True):
            require_stoppable(self._robot, name, velocity)
        stream = tool.stream(
            timeout_s=self._timeout_s,
            owner=self._owner,
            ends_when_silent=True,
            max_velocity=highest,
            source=streams.source(self._owner, self._timeout_s),  # each press is a new command
        )
        scale = self._robot.axes.speed.scale or 1.0
        return _Twist(stream, (scale * twist).tolist(), in_tool=frame == "tool")


class _Twist(StreamedMotion):
    """Motion of a tool until it is released, with a velocity in m/s and rad/s."""

    def __init__(self, stream: AnyToolStream, twist: list[float], *, in_tool: bool) -> None:
        super().__init__(stream.joints)
        self._tool_stream, self._twist, self._in_tool = stream, twist, in_tool

    @property
    def note(self) -> str:
        return self._tool_stream.slow_reason

    def beat(self) -> None:
        self._tool_stream.send(self._twist, in_tool=self._in_tool)


def _slowed(vector: Sequence[float], limit: float) -> FloatArray:
    """Return a vector with its direction, and at most ``limit`` long."""
    values: FloatArray = np.array(vector)
    return values * min(1.0, limit / max(float(np.linalg.norm(values)), limit))
