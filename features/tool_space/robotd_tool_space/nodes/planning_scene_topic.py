"""Topic of MoveIt's planning scene: its objects count as those of the scene of each arm."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from moveit_msgs.msg import PlanningScene
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.task import Future

from robotd.api import FloatArray, InvalidArgument, NotReady, RobotdError, get_logger, read_urdf
from robotd.api.models import UrdfRobot
from robotd_ros.run_nodes import NodeContext
from robotd_tool_space.collision.planning_scene import (
    ADD,
    APPEND,
    PlanningObject,
    changed_objects,
)
from robotd_tool_space.collision.scene import Scene
from robotd_tool_space.collision.scene_object import SceneObject
from robotd_tool_space.geometry.chain import Chain
from robotd_tool_space.geometry.rotations import inverse_pose
from robotd_tool_space.nodes.planning_scene_client import PlanningSceneClient
from robotd_tool_space.nodes.tf_frames import TfFrames
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.tool_groups import ToolGroups

log = get_logger("tool")

QOS = QoSProfile(depth=100)  # reliable: each message is a difference to those before
MAX_WAITING = 100  # messages
MAX_BYTES = 8_000_000  # of a message; decoding it takes about a second


class PlanningSceneTopic:
    """Applies the messages of a topic to the scenes of all arms, each whole or not at all.

    Also the response of ``get_planning_scene``: before the messages that came after its request,
    of which it may have some already. Applied again, they change nothing for good: MoveIt sends
    each object that they have as it is then, and what has changed since in a later message.

    Args:
        context, tools: of the robot, whose file has ``path`` as its URDF.
        frames: of the world.
        path: see above.
        topic: name as for ``Node.create_subscription``.
    """

    def __init__(
        self, context: NodeContext, tools: ToolGroups, frames: TfFrames, path: Path, topic: str
    ) -> None:
        self._host, node = context.host, context.operator
        prefix = node.get_parameter("frame_prefix").value
        urdf = read_urdf(path)
        self._arms = [
            _Arm(tool, tool.scene, _Links(urdf, tool.at_link.chain), frames, prefix)
            for tool in tools.values()
            if tool.scene is not None
        ]
        self._waiting: deque[bytes | Future] = deque()  # a future: of a response
        self._lock, self._taking = threading.Lock(), False
        self._last_reasons: dict[str, str] = {}  # by topic or service
        self._octomap_logged = False
        subscription = node.create_subscription(PlanningScene, topic, self._receive, QOS, raw=True)
        self._topic = subscription.topic_name
        self._client = PlanningSceneClient(
            self._host, node, subscription, self._waiting.append, self._work
        )

    def _receive(self, data: bytes) -> None:
        """Hand a message to a worker: it may wait for a frame. Executor thread."""
        with self._host.callback_guard():
            try:
                if len(self._waiting) >= MAX_WAITING:
                    raise NotReady(f"{MAX_WAITING} messages are waiting already")
                self._waiting.append(data)
                self._work()
            except RobotdError as error:
                self._reject(self._topic, error)

    def _work(self) -> None:
        """Let one worker take all that waits, in its order. Executor thread."""
        with self._lock:
            taking, self._taking = self._taking, True
        if taking:
            return
        try:
            self._host.submit(self._take_all)
        except RobotdError as error:
            self._taking = False
            self._reject(self._topic, error)

    def _take_all(self) -> None:
        while True:
            with self._lock:
                first = self._waiting[0] if self._waiting else None
                if first is None or (isinstance(first, Future) and not _has_ended(first)):
                    self._taking = False
                    return
                self._waiting.popleft()
            self._take(first)

    def _take(self, received: bytes | Future) -> None:
        whole = isinstance(received, Future)
        source = self._client.service if whole else self._topic
        try:
            if not isinstance(received, Future):
                self._apply(_decoded(received))
            elif not received.cancelled():
                self._apply_whole(received.result().scene)
        except RobotdError as error:
            self._reject(source, error)
            if whole and isinstance(error, NotReady):
                self._client.repeat()  # the arm moves
        except Exception:
            log.exception("planning scene rejected", source=source)
        else:
            self._last_reasons.pop(source, None)

    def _reject(self, source: str, error: RobotdError) -> None:
        """Log a reason once, however often the message is repeated."""
        if self._last_reasons.get(source) != str(error):
            self._last_reasons[source] = str(error)
            log.warning("planning scene rejected", source=source, reason=str(error))

    def _apply_whole(self, message: Any) -> None:
        message.is_diff = message.robot_state.is_diff = False
        self._apply(message)
        count = len(message.world.collision_objects)
        attached = len(message.robot_state.attached_collision_objects)
        service = self._client.service
        log.info("planning scene of MoveIt", service=service, objects=count, attached=attached)

    def _apply(self, message: Any) -> None:
        if len(message.world.octomap.octomap.data) and not self._octomap_logged:
            self._octomap_logged = True
            log.warning("octomap of the planning scene is ignored", topic=self._topic)
        for attached in message.robot_state.attached_collision_objects:
            self._require_carried(attached)
        changes = [(arm, arm.changed(message)) for arm in self._arms]
        for arm, change in changes:
            arm.check(change)
        for arm, change in changes:
            arm.use(change)

    def _require_carried(self, attached: Any) -> None:
        link, adds = attached.link_name, attached.object.operation[0] in (ADD, APPEND)
        if adds and not any(link in arm.carried for arm in self._arms):
            links = ", ".join(name for arm in self._arms for name in arm.carried)
            text = f"link {link!r} is not fixed to a tool (available: {links})"
            raise InvalidArgument(f"{attached.object.id}: {text}")


def _has_ended(future: Future) -> bool:
    return bool(future.done() or future.cancelled())


def _decoded(data: bytes) -> Any:
    if len(data) > MAX_BYTES:
        raise InvalidArgument(f"message has {len(data)} bytes, at most {MAX_BYTES}")
    return deserialize_message(data, PlanningScene)


class _Links:
    """Links of the URDF whose frames follow from the positions of one arm.

    Attributes:
        carried: poses (4, 4) in the link of the tool, by link, of those that are fixed to it.
    """

    def __init__(self, urdf: UrdfRobot, chain: Chain) -> None:
        self._urdf, self._chain = urdf, chain
        self.root = urdf.root
        self._moving = {urdf.joint[name].child: index for index, name in enumerate(chain.moving)}
        tool, tool_pose = self._fixed_to(chain.link)
        self.carried = {
            link: inverse_pose(tool_pose) @ pose
            for link in urdf.links
            for carrier, pose in [self._fixed_to(link)]
            if carrier == tool
        }

    def _fixed_to(self, link: str) -> tuple[str, FloatArray]:
        """Return the link that holds ``link`` by fixed joints alone, and the pose (4, 4) in it."""
        top = link
        while top in self._urdf.parent_joint and not self._urdf.parent_joint[top].moves:
            top = self._urdf.parent_joint[top].parent
        return top, self._urdf.pose(link, {}, top)

    def fixed_in_base(self, link: str) -> FloatArray | None:
        """Return the pose (4, 4) of a link that does not move in the base; None: it may."""
        if link not in self._urdf.links:
            return None
        (top, pose), (base_top, base) = self._fixed_to(link), self._fixed_to(self._chain.base)
        return inverse_pose(base) @ pose if top == base_top else None

    def moves(self, link: str) -> bool:
        """Return True for a link that the joints of the arm move."""
        return link in self._urdf.links and self._fixed_to(link)[0] in self._moving

    def moved_in_base(self, link: str, positions: FloatArray) -> FloatArray:
        """Return the pose (4, 4) of a link that moves, at positions (n,)."""
        top, pose = self._fixed_to(link)
        moved: FloatArray = self._chain.frames(positions)[self._moving[top]] @ pose
        return moved


class _ArmFrames:
    """Frames for one message: those that move are where the arm rests; see ``ArmFrames``.

    Attributes:
        positions: (n,) that they are of; None: of none.
    """

    def __init__(self, tool: RobotTool, links: _Links, frames: TfFrames, prefix: str) -> None:
        self._tool, self._links, self._frames, self._prefix = tool, links, frames, prefix
        self.positions: FloatArray | None = None

    def in_base(self, frame: str) -> FloatArray:
        link = frame.removeprefix(self._prefix) or self._links.root
        fixed = self._links.fixed_in_base(link)
        if fixed is not None:
            return fixed
        if self._links.moves(link):
            return self._links.moved_in_base(link, self._at_rest())
        try:
            return self._frames.find(self._tool.base, frame or self._prefix + link)
        except InvalidArgument as error:
            raise InvalidArgument(f"frame {frame!r}: {error}") from None

    def in_tool(self, frame: str) -> FloatArray:
        carried = self._links.carried.get(frame.removeprefix(self._prefix))
        return (
            inverse_pose(self.tool_in_base()) @ self.in_base(frame) if carried is None else carried
        )

    def tool_in_base(self) -> FloatArray:
        return self._tool.at_link.forward(self._at_rest())

    def carries(self, link: str) -> bool:
        return link in self._links.carried

    def _at_rest(self) -> FloatArray:
        if self.positions is None:
            self.positions = self._tool.start()
        return self.positions


class _Change(NamedTuple):
    """Objects after a message, and the positions (n,) of the arm that they are of, if of any."""

    objects: Mapping[str, PlanningObject]
    positions: FloatArray | None

    def items(self) -> list[SceneObject]:
        return [item for name, one in self.objects.items() for item in one.items(name)]


class _Arm:
    """Part of the planning scene in the scene of one arm. One worker thread at a time."""

    def __init__(
        self, tool: RobotTool, scene: Scene, links: _Links, frames: TfFrames, prefix: str
    ) -> None:
        self._tool, self._scene, self._links = tool, scene, links
        self._frames, self._prefix = frames, prefix
        self._known = _Change({}, None)

    @property
    def carried(self) -> Collection[str]:
        """Links that are fixed to the link of the tool."""
        return self._links.carried

    def changed(self, message: Any) -> _Change:
        """Return the objects after a message. Raises InvalidArgument, NotReady."""
        if not any(item.in_planning_scene for item in self._scene.objects):
            self._known = _Change({}, None)  # the service has removed all
        frames = _ArmFrames(self._tool, self._links, self._frames, self._prefix)
        objects = changed_objects(message, self._known.objects, frames)
        return _Change(objects, frames.positions)

    def check(self, change: _Change) -> None:
        """Raise InvalidArgument where an object cannot be."""
        self._scene.with_planned(change.items())

    def use(self, change: _Change) -> None:
        """Exchange the objects where a message has changed any. Raises NotReady."""
        items = change.items()
        if not _are_same(items, self._known.items()):
            if change.positions is None:
                self._scene.exchange_planned(items)
            else:
                with self._scene.rest():
                    if not np.array_equal(self._tool.start(), change.positions):
                        raise NotReady("the arm has moved meanwhile")
                    self._scene.exchange_planned(items)
        self._known = change


def _are_same(items: Sequence[SceneObject], others: Sequence[SceneObject]) -> bool:
    """Return True where nothing differs, as in a message of the robot's state alone."""

    def content(item: SceneObject) -> tuple[Any, ...]:
        return item.name, item.shape, item.size_m, item.attached, item.touch_links

    return [*map(content, items)] == [*map(content, others)] and all(
        np.allclose(one.pose, other.pose, rtol=0.0, atol=1e-9)
        for one, other in zip(items, others, strict=True)
    )
