"""Dead-man jog of the tool of a running robot from another process."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace

from geometry_msgs.msg import TwistStamped
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from robotd.errors import OperationError
from robotd_ros.client.jog_client import JogClient, JogState
from robotd_ros.client.ros_client import RosClient
from robotd_ros.node_registry import OPERATOR_NODE

TWISTS = "servo_node/delta_twist_cmds"
REASON = "servo_node/status_message"
TOOL_POSE = f"{OPERATOR_NODE}/tool_pose"
DIRECTIONS = ("x", "y", "z", "turn about x", "turn about y", "turn about z")


class ToolJogClient(JogClient):
    """Publisher of twists, and the state of the axes. One thread.

    Args:
        client: of the robot.
        stack: leaves its subscriptions.
        in_tool: directions are those of the tool; False: of the base.
    """

    topic, message_type = TWISTS, TwistStamped

    def __init__(self, client: RosClient, stack: ExitStack, *, in_tool: bool) -> None:
        super().__init__(client, stack)
        self.choices = DIRECTIONS
        poses = stack.enter_context(client.listen(TFMessage, TOOL_POSE))
        pose = poses.wait().transforms[0]
        self._frame = pose.child_frame_id if in_tool else pose.header.frame_id
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
        return replace(state, hindrance=state.hindrance or slowed)


@contextmanager
def tool_jog_client(client: RosClient, *, in_tool: bool) -> Iterator[ToolJogClient]:
    """Find the running robot.

    Raises:
        DeviceTimeout: no robot with the node ``servo_node`` answers.
        OperationError: motion is stopped or paused.
    """
    with ExitStack() as stack:
        jog = ToolJogClient(client, stack, in_tool=in_tool)
        if reason := jog.state().hindrance:
            raise OperationError(reason)
        yield jog
