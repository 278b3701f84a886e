"""State of a running robot as it changes, from its topics alone."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

from control_msgs.action import FollowJointTrajectory
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage
from wmx_ros2_message.msg import AxisState

from robotd.clock import NANOSECONDS
from robotd.control.groups.problem import Problem
from robotd_ros.client.fleet import SILENCE_S
from robotd_ros.client.motion_client import action_servers
from robotd_ros.client.operator_client import ProblemListener
from robotd_ros.client.ros_client import Listener, RosClient
from robotd_ros.client.status_client import (
    AXIS_STATE,
    TOOL_POSE,
    AxisReport,
    ToolReport,
    axis_reports,
    published_axes,
    tool_reports,
)
from robotd_ros.qos import LATCHED

GOAL_SILENCE_S = 0.5  # after the last feedback of a goal it has ended


@dataclass(frozen=True)
class PartReport:
    """Part of ``/diagnostics``; levels are 0 OK, 1 WARN, 2 ERROR, 3 STALE."""

    name: str
    level: int
    message: str


@dataclass(frozen=True)
class LiveReport:
    """Newest state.

    Attributes:
        ready: the robot takes commands; None: it does not answer.
        axes: None while they are not published.
        parts: engine, axes, fieldbus, control loop.
        goals_s: time that each running goal has got to on its path, seconds, by its action.
        tools: of each joint group; empty while their poses are not known.
        problems: what keeps axes from moving, root cause first.
    """

    ready: bool | None
    axes: tuple[AxisReport, ...] | None
    parts: tuple[PartReport, ...]
    goals_s: Mapping[str, float]
    tools: tuple[ToolReport, ...] = ()
    problems: tuple[Problem, ...] = ()

    @property
    def takes_motion(self) -> bool:
        """True where the robot is ready, and neither a fault nor a stop forbids motion."""
        return bool(self.ready) and not any(problem.forbids_motion for problem in self.problems)


class DiagnosticsListener(Listener):
    """Diagnostics of the client's robot; all robots, and other programs, share the topic."""

    def _keep(self, message: Any) -> None:
        namespace = self._client.node.get_namespace().strip("/")
        first = message.status[0] if message.status else DiagnosticStatus()
        is_robot = first.name.startswith(f"robotd/{first.hardware_id}: ")
        if is_robot and first.hardware_id.rpartition("/")[0] == namespace:
            super()._keep(message)


class LiveStatus:
    """Subscriptions of a robot's state: ``with live_status(client) as status:``. One thread."""

    def __init__(self, client: RosClient, stack: ExitStack) -> None:
        def listen(message_type: Any, topic: str, qos: Any = 1) -> Listener:
            return stack.enter_context(client.listen(message_type, topic, qos))

        self._ready = listen(Bool, "wmx/engine/ready", LATCHED)
        self._axes = listen(AxisState, AXIS_STATE)
        diagnostics = DiagnosticsListener(client, DiagnosticArray, "/diagnostics", 10)
        self._diagnostics = stack.enter_context(diagnostics)
        self._tools = listen(TFMessage, TOOL_POSE)
        self._problems = ProblemListener(client, stack)
        self._ready.wait()
        feedback = FollowJointTrajectory.Impl.FeedbackMessage
        self._goals = {
            action: listen(feedback, f"{action}/_action/feedback")
            for action, _ in action_servers(client.node)
        }
        self._identities = published_axes(client)

    def report(self) -> LiveReport:
        """Return the newest state; never waits."""
        if time.monotonic() - self._diagnostics.newest_s > SILENCE_S:
            return LiveReport(None, None, (), {})
        ready, axes = self._ready.newest, self._axes.newest
        is_ready = None if ready is None else bool(ready.data)
        statuses = self._diagnostics.newest.status if self._diagnostics.newest else ()
        parts = tuple(
            PartReport(status.name.rpartition(": ")[2], status.level[0], status.message)
            for status in statuses
        )
        has_axes = is_ready and axes is not None and self._identities
        reports = axis_reports(axes, self._identities) if has_axes else None
        running = {action: _path_s(feedback) for action, feedback in self._goals.items()}
        goals_s = {action: path_s for action, path_s in running.items() if path_s is not None}
        tools = tool_reports(self._tools.newest) if is_ready and self._tools.newest else ()
        return LiveReport(is_ready, reports, parts, goals_s, tools, self._problems.newest)


def _path_s(feedback: Listener) -> float | None:
    """Return the time that a goal has got to on its path, seconds; None: no goal runs."""
    if feedback.newest is None or time.monotonic() - feedback.newest_s > GOAL_SILENCE_S:
        return None
    passed = feedback.newest.feedback.desired.time_from_start
    return float(passed.sec + passed.nanosec / NANOSECONDS)


@contextmanager
def live_status(client: RosClient) -> Iterator[LiveStatus]:
    """Subscribe to the state of the running robot. Raises DeviceTimeout when there is none."""
    with ExitStack() as stack:
        yield LiveStatus(client, stack)
