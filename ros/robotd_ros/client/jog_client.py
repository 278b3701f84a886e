"""Dead-man jog of a running robot, its axes or its tool, from another process."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from geometry_msgs.msg import TwistStamped
from robotd_msgs.msg import CommandRejection
from std_msgs.msg import String
from wmx_ros2_message.msg import AxisState, AxisVelocity

from robotd.errors import OperationError
from robotd.log import escaped
from robotd_ros.client.operator_client import BLOCKING, ProblemListener, with_remedy
from robotd_ros.client.ros_client import RosClient
from robotd_ros.client.status_client import (
    AXIS_STATE,
    AxisReport,
    axis_reports,
    read_axes,
)
from robotd_ros.client.tool_client import tool_pose
from robotd_ros.operator_messages import REJECTIONS

JOG = "wmx/axis/jog"
RAMP_S = 0.2  # to the speed, of axes in velocity mode
AT_REST = 0.01  # rad/s or m/s
TWISTS = "servo_node/delta_twist_cmds"
REASON = "servo_node/status_message"
DIRECTIONS = ("x", "y", "z", "turn about x", "turn about y", "turn about z")


@dataclass(frozen=True)
class JogState:
    """Newest state.

    Attributes:
        axes: None before the first message.
        blocked_by: why nothing moves, and what helps where it is known; "" while motion is allowed.
    """

    axes: tuple[AxisReport, ...] | None
    blocked_by: str


class JogClient:
    """Publisher of jogs, and the state of the axes. One thread.

    Attributes:
        identities: of the axes, by index.
        choices: names of what ``jog`` moves, by index.
        topic, message_type: of the commands.
    """

    topic: ClassVar[str] = JOG
    message_type: ClassVar[Any] = AxisVelocity

    def __init__(self, client: RosClient, stack: ExitStack) -> None:
        self._client = client
        self._jogged: set[int] = set()
        self._rejection = ""
        self.identities = read_axes(client)
        self.choices: Sequence[str] = [identity.name for identity in self.identities]
        self._publisher = client.node.create_publisher(self.message_type, self.topic, 1)
        self._axes = stack.enter_context(client.listen(AxisState, AXIS_STATE))
        self._problems = ProblemListener(client, stack)
        client.node.create_subscription(CommandRejection, REJECTIONS, self._note_rejection, 10)
        self._axes.wait()
        self._problems.wait()
        client.wait(self._publisher.get_subscription_count, f"subscription of {self.topic}")

    def jog(self, axis: int, velocity: float, fastest: float) -> None:
        """Move ``axis``; the robot stops it 0.2 s after the last call.

        Args:
            velocity: rad/s or m/s, signed; 0 slows to rest.
            fastest: velocity that an axis in velocity mode reaches in ``RAMP_S``.
        """
        self._jogged.add(axis)
        ramp = fastest / RAMP_S
        message = AxisVelocity(index=[axis], velocity=[velocity], acc=[ramp], dec=[ramp])
        self._publisher.publish(message)

    def state(self) -> JogState:
        """Return the newest state; never waits."""
        axes = self._axes.newest
        reports = None if axes is None else axis_reports(axes, self.identities)
        if any(abs(reports[axis].velocity) > AT_REST for axis in self._jogged if reports):
            self._rejection = ""
        problem = self._problems.first(*BLOCKING)
        return JogState(reports, with_remedy(problem) if problem else self._rejection)

    def wait_at_rest(self) -> None:
        """Return when no axis that was jogged moves. Raises DeviceTimeout."""

        def at_rest() -> bool:
            axes = self.state().axes or ()
            return all(abs(axes[axis].velocity) < AT_REST for axis in self._jogged)

        self._axes.newest = None
        self._axes.wait()
        self._client.wait(at_rest, "standstill")

    def _note_rejection(self, rejection: CommandRejection) -> None:
        if rejection.topic == self.topic:
            self._rejection = escaped(rejection.reason)


class ToolJogClient(JogClient):
    """Publisher of twists, and the state of the axes. One thread.

    Args:
        stack: leaves its subscriptions.
        tool: directions are those of the "base", the "tool" or the chosen work "frame".
    """

    topic, message_type = TWISTS, TwistStamped

    def __init__(self, client: RosClient, stack: ExitStack, tool: str) -> None:
        super().__init__(client, stack)
        self.choices = DIRECTIONS
        _, work_frame, name = tool_pose(client)
        self._frame = {"base": "", "tool": name, "frame": work_frame}[tool]
        self._reason = stack.enter_context(client.listen(String, REASON))
        self._jogged.update(range(len(self.identities)))

    def jog(self, axis: int, velocity: float, fastest: float) -> None:
        """Move the tool along the direction ``axis`` of ``DIRECTIONS``, m/s or rad/s."""
        message = TwistStamped()
        message.header.frame_id = self._frame
        part = message.twist.linear if axis < 3 else message.twist.angular
        setattr(part, "xyz"[axis % 3], velocity)
        self._publisher.publish(message)

    def state(self) -> JogState:
        """Return the newest state, with the reason why the tool is slowed down."""
        state = super().state()
        slowed = self._reason.newest.data if self._reason.newest else ""
        return replace(state, blocked_by=state.blocked_by or slowed)


@contextmanager
def jog_client(client: RosClient, tool: str | None = None) -> Iterator[JogClient]:
    """Find the running robot.

    Args:
        tool: jog the tool, in the axes of "base", "tool" or work "frame"; None: the axes of the
            robot.

    Raises:
        DeviceTimeout: no robot with the node ``wmx_core_motion_node`` answers, or ``servo_node``
            for a tool.
        OperationError: motion is stopped or paused.
    """
    with ExitStack() as stack:
        jog = JogClient(client, stack) if tool is None else ToolJogClient(client, stack, tool)
        if reason := jog.state().blocked_by:
            raise OperationError(reason)
        yield jog
