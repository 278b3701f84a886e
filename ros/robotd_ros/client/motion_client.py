"""Move a running arm by its FollowJointTrajectory action, from another process."""

from __future__ import annotations

import posixpath
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, NoReturn
from uuid import uuid4

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionClient, get_action_server_names_and_types_by_node
from rclpy.action.client import ClientGoalHandle
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from unique_identifier_msgs.msg import UUID

from robotd.errors import DeviceTimeout, InvalidArgument, OperationError, unknown_name
from robotd_ros.client.operator_client import reason_of_silence
from robotd_ros.client.ros_client import RosClient
from robotd_ros.group_parameters import ACTION_PARAMETER, GROUPS, JOINTS
from robotd_ros.trajectory_messages import duration_s, trajectory_of

JOINT_STATES = "joint_states"
MAY_MOVE = "the arm may be moving, robotd stop stops it"
BASE_NODES = ("diff_drive_controller", "mecanum_drive_controller", "tricycle_controller")
ACTION_TYPE = "control_msgs/action/FollowJointTrajectory"

_SETTLE_S = 0.6  # a second robotd is found within this time after the first one

Groups = Mapping[str, Sequence[str]]
"""Joints of each action of a robot with joint groups."""

Positions = Mapping[str, float]
OnProgress = Callable[[float, Positions], None]


class Ending(Enum):
    """Outcome of a motion; the arm is at rest."""

    REACHED = "reached"
    CANCELED = "canceled"
    ABORTED = "aborted"  # or rejected, and nothing moved


_ENDINGS = {
    GoalStatus.STATUS_SUCCEEDED: Ending.REACHED,
    GoalStatus.STATUS_CANCELED: Ending.CANCELED,
}


@dataclass(frozen=True)
class Arm:
    """An arm that takes trajectories.

    Attributes:
        action: resolved name of its action.
        namespace: of the node that serves it.
        positions: every joint of the arm or the joint group, in the robot's order, and where it
            was; rad or m.
        units: "rad" or "m" of each joint, for joints whose robot states it.
    """

    action: str
    namespace: str
    positions: Positions
    units: Mapping[str, str]

    def check(self, joints: Collection[str]) -> None:
        """Raise InvalidArgument for a joint that the arm does not have."""
        for joint in joints:
            if joint not in self.positions:
                raise InvalidArgument(unknown_name("joint", joint, self.positions))


def find_arm(client: RosClient, joints: Collection[str], action: str | None = None) -> Arm:
    """The only arm that is running in the client's namespace, or the one with ``action``.

    Of a robot with joint groups: the group that has ``joints``.

    Raises:
        DeviceTimeout: there is none, or its joint states do not come.
        InvalidArgument: no joint group has one of ``joints``, or several have them.
        OperationError: there are several and ``action`` is None, or its robot is not ready.
    """
    name, node = _find_action(client, action)
    namespace = posixpath.dirname(node)  # with ``action``, may be below that of the client
    topic = posixpath.join(namespace, JOINT_STATES)
    with reason_of_silence(client, namespace), client.listen(JointState, topic) as joint_states:
        # Other servers may have neither.
        count, units = client.parameters(node, ["joint_number", "joint_units"]) or (None, None)
        groups = _groups(client, node)
        names = joint_states.wait().name[:count]
        if action is None:
            _check_only_one(client, groups)
        positions = dict(zip(names, joint_states.newest.position, strict=False))
        unit_of = dict(zip(names, units or (), strict=False))
        if groups:
            group = _action_of(joints, groups)
            name = name if action else group
            positions = {joint: positions[joint] for joint in groups[group]}
        return Arm(name, namespace, positions, unit_of)


def move(
    client: RosClient,
    arm: Arm,
    targets: Positions,
    time_s: float,
    is_canceled: Callable[[], bool],
    on_progress: OnProgress,
) -> tuple[Ending, str]:
    """Move joints to ``targets``; return at standstill, with the robot's reason.

    Args:
        targets: rad or m.
        time_s: duration of the motion.
        is_canceled: asked all the time; once it is true, the robot is asked to stop.
        on_progress: called with the seconds since the start, and all positions.

    Raises:
        InvalidArgument: the arm has no such joint; nothing moved.
        DeviceTimeout: no answer or no feedback for ``timeout_s`` of the client. The goal was
            canceled; the text says what came of that.
    """
    arm.check(targets)
    positions = {**arm.positions, **targets}
    trajectory = trajectory_of([*positions], [time_s], [[*positions.values()]])
    return follow(client, arm, trajectory, is_canceled, on_progress)


def follow(
    client: RosClient,
    arm: Arm,
    trajectory: JointTrajectory,
    is_canceled: Callable[[], bool],
    on_progress: OnProgress,
) -> tuple[Ending, str]:
    """Move joints along a trajectory; return at standstill, with the robot's reason.

    Args:
        trajectory: of the joints of the arm; see ``trajectory_of``.
        is_canceled, on_progress: see ``move``.

    Raises DeviceTimeout: see ``move``.
    """

    def show(feedback: Any) -> None:
        names, positions = feedback.joint_names, feedback.actual.positions
        passed_s = duration_s(feedback.desired.time_from_start)
        on_progress(passed_s, dict(zip(names, positions, strict=True)))

    run = GoalRun(client, FollowJointTrajectory, show, lambda result: str(result.error_string))
    goal = FollowJointTrajectory.Goal(trajectory=trajectory)
    return run.run(arm.action, goal, is_canceled)


class GoalRun:
    """One goal of an action, from sending it to its result.

    Args:
        text_of: returns the robot's reason of a result.
    """

    def __init__(
        self,
        client: RosClient,
        action_type: Any,
        on_feedback: Callable[[Any], None],
        text_of: Callable[[Any], str],
    ) -> None:
        self._client, self._type = client, action_type
        self._show, self._text_of = on_feedback, text_of
        self._feedback_s = time.monotonic()

    def run(self, action: str, goal: Any, is_canceled: Callable[[], bool]) -> tuple[Ending, str]:
        """Send a goal of ``action``; return how it ended, at rest. Errors as of ``move``."""
        actions = ActionClient(self._client.node, self._type, action)
        try:
            self._client.wait(actions.server_is_ready, f"action {action}")
            return self._run(actions, goal, is_canceled)
        finally:
            actions.destroy()

    def _run(
        self, actions: ActionClient, goal: Any, is_canceled: Callable[[], bool]
    ) -> tuple[Ending, str]:
        goal_id = UUID(uuid=[*uuid4().bytes])
        sending = actions.send_goal_async(goal, self._on_feedback, goal_id)
        if not self._comes(sending):
            # A handle without the answer: the goal may have been accepted all the same.
            unanswered = self._type.Impl.SendGoalService.Response()
            self._give_up(ClientGoalHandle(actions, goal_id, unanswered), "no answer to the goal")
        handle = sending.result()
        if not handle.accepted:
            return Ending.ABORTED, "the robot did not accept the goal"
        result = handle.get_result_async()
        cancel = None
        self._feedback_s = time.monotonic()
        while not result.done():
            self._client.spin()
            if cancel is None and is_canceled():
                cancel = handle.cancel_goal_async()
            if time.monotonic() - self._feedback_s > self._client.timeout_s:
                self._give_up(handle, "no feedback from the robot")
        answer = result.result()
        return _ENDINGS.get(answer.status, Ending.ABORTED), self._text_of(answer.result)

    def _give_up(self, handle: ClientGoalHandle, why: str) -> NoReturn:
        """Cancel the goal. Raises DeviceTimeout, with what came of it."""
        cancel, result = handle.cancel_goal_async(), handle.get_result_async()
        begin = f"{why} within {self._client.timeout_s:g} s"
        if not self._comes(cancel):
            raise DeviceTimeout(f"{begin}, and the cancel was not answered: {MAY_MOVE}")
        if cancel.result().return_code == CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID:
            raise DeviceTimeout(f"{begin}: the robot has not received it, nothing moved")
        if not self._comes(result):
            raise DeviceTimeout(f"{begin}: canceled, but no result came: {MAY_MOVE}")
        answer = result.result()
        state = _ENDINGS.get(answer.status, Ending.ABORTED).value
        raise DeviceTimeout(f"{begin}; it was {state}: {self._text_of(answer.result)}")

    def _comes(self, future: Any) -> bool:
        """Wait for an answer, ``timeout_s`` of the client at most; return whether it came."""
        end_s = time.monotonic() + self._client.timeout_s
        while not future.done() and time.monotonic() < end_s:
            self._client.spin()
        return bool(future.done())

    def _on_feedback(self, message: Any) -> None:
        self._feedback_s = time.monotonic()
        self._show(message.feedback)


def _find_action(client: RosClient, action: str | None) -> tuple[str, str]:
    """Names of the action and of the node that serves it.

    Without a name it is one of the client's own namespace, which all other commands address.
    """
    name = action and client.node.resolve_topic_name(action)
    own = client.node.get_namespace()

    def find() -> list[tuple[str, str]]:
        return [
            found
            for found in action_servers(client.node)
            if (found[0] == name if name else posixpath.dirname(found[1]) == own)
        ]

    what = f"action {name}" if name else "arm (a FollowJointTrajectory action)"
    try:
        found: tuple[str, str] = client.wait(find, what)[0]
    except DeviceTimeout as error:
        if not _has_base(client):
            raise
        what = "no arm: a base runs here, which is driven from the page or by topic (cmd_vel)"
        raise DeviceTimeout(f"{what} ({error})") from error
    return found


def _has_base(client: RosClient) -> bool:
    """Return whether a controller of a base runs in the client's namespace."""
    own = client.node.get_namespace()
    nodes = client.node.get_node_names_and_namespaces()
    return any(name in BASE_NODES and place == own for name, place in nodes)


def _check_only_one(client: RosClient, groups: Groups) -> None:
    """Raise OperationError for several arms, when discovery has ended.

    The actions of ``groups`` are one arm.
    """
    client.settle(_SETTLE_S)
    servers = [server for server in action_servers(client.node) if server[0] not in groups]
    if groups:
        servers += [(", ".join(groups), "joint groups of one robot")]
    if len(servers) > 1 and len({*servers}) == 1:
        what = f"{len(servers)} robots share the action {servers[0][0]}"
        raise OperationError(f"{what}: give each a namespace of its own")
    if len(servers) > 1:
        listing = ", ".join(f"{action} (of {node})" for action, node in servers)
        raise OperationError(f"several arms: choose one by --action (available: {listing})")


def action_servers(node: Node) -> list[tuple[str, str]]:
    """FollowJointTrajectory actions in the client's namespace or below, and the servers' nodes."""
    servers = []
    own = node.get_namespace().rstrip("/")
    for name, namespace in node.get_node_names_and_namespaces():
        if not f"{namespace.rstrip('/')}/".startswith(f"{own}/"):
            continue
        try:
            actions = get_action_server_names_and_types_by_node(node, name, namespace)
        except Exception:  # noqa: BLE001, S112 - the node has gone in between
            continue
        for action, types in actions:
            if ACTION_TYPE in types:
                servers.append((action, f"{namespace.rstrip('/')}/{name}"))
    return sorted(servers)


def _action_of(joints: Collection[str], groups: Groups) -> str:
    """Return the action of the group that has all ``joints``. Raises InvalidArgument."""
    action_of = {joint: action for action, group in groups.items() for joint in group}
    for joint in joints:
        if joint not in action_of:
            raise InvalidArgument(unknown_name("joint", joint, action_of))
    found = {action_of[joint]: joint for joint in joints}
    if len(found) > 1:
        listing = ", ".join(f"{joint} by {action}" for action, joint in found.items())
        raise InvalidArgument(f"one joint group moves at a time, not {listing}")
    return next(iter(found))


def _groups(client: RosClient, node: str) -> Groups:
    """Return the joints of each action of ``node``; empty for a robot without joint groups."""
    names = client.parameters(node, [GROUPS])
    if not names or not names[0]:
        return {}
    keys = [f"{group}.{key}" for group in names[0] for key in (ACTION_PARAMETER, JOINTS)]
    values = client.parameters(node, keys)
    namespace = posixpath.dirname(node)
    actions = [posixpath.join(namespace, action) for action in values[::2]]
    return dict(zip(actions, values[1::2], strict=True))
