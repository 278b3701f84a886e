"""Frames of the world from ``/tf`` and ``/tf_static``, received while they are needed."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection
from contextlib import closing
from functools import partial
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.time import Time
from tf2_msgs.msg import TFMessage

from robotd.api import FloatArray, InvalidArgument, get_logger
from robotd_ros.middleware import RateLimit
from robotd_ros.run_nodes import NodeContext
from robotd_tool_space.frames.followed_frame import FOLLOWED, MAX_AGE_S, NANOSECONDS, FollowedFrame
from robotd_tool_space.geometry.rotations import quaternion_pose
from robotd_tool_space.geometry.transform_tree import Placed, TransformTree

log = get_logger("tool")

TF, TF_STATIC = "/tf", "/tf_static"
TF_QOS = QoSProfile(depth=100)
STATIC_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
WAIT_S = 3.0  # for the transforms of a frame
HANDLER_SHARE = 0.2  # of the executor's time; more transforms are dropped


class TfFrames:
    """Frames of the world by the names that they have in ROS. Worker threads."""

    def __init__(self, context: NodeContext) -> None:
        self._context, self._robot = context, context.robot
        self._prefix = context.operator.get_parameter("frame_prefix").value

    def find(self, base: str, name: str) -> FloatArray:
        """Return the pose (4, 4) of a frame in a link of the robot; wait for it.

        Raises InvalidArgument: there was none in time.
        """
        with closing(_Listener(self._context, self._prefix + base, name)) as listener:
            return listener.wait(lambda placed: True).pose

    def follow(
        self, base: str, name: str, carried: Collection[str], on_failure: Callable[[str], None]
    ) -> FollowedFrame:
        """Return a frame that is followed, in a link of the robot; wait for it.

        ``carried`` are the links that the arm moves. Raises InvalidArgument: there was none in
        time; NotReady: it cannot be followed.
        """
        now_ns = self._robot.clock.now_ns

        def is_recent(placed: Placed) -> bool:
            oldest_ns = placed.oldest_ns
            return oldest_ns is None or now_ns() - oldest_ns < MAX_AGE_S * NANOSECONDS

        listener = _Listener(self._context, self._prefix + base, name)
        try:
            frames = {self._prefix + link for link in carried}
            placed = listener.wait(is_recent)
            followed = FollowedFrame(FOLLOWED + name, placed, now_ns, frames, on_failure)
        except BaseException:
            listener.close()
            raise
        followed.on_end = listener.close
        listener.on_placed = followed.take
        return followed


class _Listener:
    """Pose of one frame in another one, with each message, until it is closed.

    Attributes:
        on_placed: called with each pose. Executor thread.
    """

    def __init__(self, context: NodeContext, base: str, name: str) -> None:
        self.on_placed: Callable[[Placed], None] = lambda placed: None
        self._base, self._name = base, name
        self._host, self._node = context.host, context.operator
        self._now_ns, self._ros_clock = context.robot.clock.now_ns, context.operator.get_clock()
        self._tree, self._limit = TransformTree(), RateLimit(HANDLER_SHARE)
        self._placed: Placed | None = None
        self._missing = ""
        self._invalid: set[str] = set()
        self._changed = threading.Condition()
        self._subscriptions = [
            self._node.create_subscription(
                TFMessage, topic, partial(self._receive, is_static), qos, raw=True
            )
            for topic, qos, is_static in ((TF, TF_QOS, False), (TF_STATIC, STATIC_QOS, True))
        ]

    def close(self) -> None:
        """End it; a second call does nothing."""
        while self._subscriptions:
            self._node.destroy_subscription(self._subscriptions.pop())

    def wait(self, is_good: Callable[[Placed], bool]) -> Placed:
        """Return the first pose that is good. Raises InvalidArgument: none came in time."""

        def found() -> bool:
            return self._placed is not None and is_good(self._placed)

        with self._changed:
            if self._changed.wait_for(found, WAIT_S) and self._placed is not None:
                return self._placed
            reason = self._missing or self._tree_reason()
        raise InvalidArgument(f"{reason}, after {WAIT_S:g} s")

    def _tree_reason(self) -> str:
        try:
            placed = self._tree.find(self._base, self._name)
        except InvalidArgument as error:
            return str(error)
        age_s = (self._now_ns() - (placed.oldest_ns or 0)) / NANOSECONDS
        return f"transforms of frame {self._name!r} are {age_s:.1f} s old, at most {MAX_AGE_S:g} s"

    def _receive(self, is_static: bool, data: bytes) -> None:
        with self._host.callback_guard():
            if is_static or self._limit.is_left():
                with self._limit.spent():
                    self._take(is_static, deserialize_message(data, TFMessage))

    def _take(self, is_static: bool, message: Any) -> None:
        for transform in message.transforms:
            place, turn = transform.transform.translation, transform.transform.rotation
            parent, child = transform.header.frame_id, transform.child_frame_id
            try:
                numbers = (turn.x, turn.y, turn.z, turn.w)
                pose = quaternion_pose((place.x, place.y, place.z), numbers)
            except InvalidArgument as error:
                if child not in self._invalid:
                    self._invalid.add(child)
                    log.warning("transform ignored", frame=child, reason=str(error))
                continue
            time_ns = None if is_static else self._measured_ns(transform.header.stamp)
            self._tree.put(parent, child, pose, time_ns)
        try:
            placed = self._tree.find(self._base, self._name)
        except InvalidArgument:
            return
        with self._changed:
            self._placed = placed
            self._changed.notify_all()
        self.on_placed(placed)

    def _measured_ns(self, stamp: Any) -> int:
        """Return the time of a stamp on the clock of the robot; now for 0, or one of the future."""
        now_ns, stamp_ns = self._now_ns(), Time.from_msg(stamp).nanoseconds
        age_ns = self._ros_clock.now().nanoseconds - stamp_ns if stamp_ns else 0
        return now_ns - max(0, age_ns)
