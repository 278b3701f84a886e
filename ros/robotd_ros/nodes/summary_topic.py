"""Topic ``robotd/summary``: identity and state of the robot, for lists of several."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Sequence
from typing import Any, Self

from rclpy.node import Node
from std_msgs.msg import String

from robotd.control.problem import ProblemKind
from robotd.log import get_logger
from robotd.observation.robot_identity import identity
from robotd.robot import Robot
from robotd_ros.node_registry import SUMMARY
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.qos import LATCHED

log = get_logger("summary")

LOOK_PERIOD_S = 0.25
HEARTBEAT_S = 1.0  # a list shows a robot whose computer has gone long before discovery does

MAX_PROBLEMS = 8
READY = "ready"
# The first of these kinds that a robot has is its state.
STATES = {
    ProblemKind.ENDING: "shutting down",
    ProblemKind.STARTING: "starting",
    ProblemKind.DEVICE: "no device",
    ProblemKind.CONTROLLER: "fault",
    ProblemKind.ALARM: "fault",
    ProblemKind.OFFLINE: "fault",
    ProblemKind.STOPPED: "stopped",
    ProblemKind.SERVO_OFF: "servo off",
}


class SummaryTopic:
    """Publishes the summary where it changes and once a second, in the thread ``robotd-summary``.

    Not in the executor: the reason for a lost device is asked of its driver, which may take long.

    Args:
        features: names of those that run.
    """

    def __init__(self, node: Node, robot: Robot, features: Sequence[str]) -> None:
        self._robot = robot
        self._identity = {**identity(robot, node.get_namespace()), "features": [*features]}
        self._began_s = time.monotonic()
        self._shown: dict[str, Any] = {}
        self._due_s = 0.0
        self._publisher = node.create_publisher(String, SUMMARY, LATCHED)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="robotd-summary", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(HEARTBEAT_S)  # a driver that hangs does not hold up the end

    def _run(self) -> None:
        is_failing = False
        while not self._stop.wait(LOOK_PERIOD_S):
            try:
                self._look()
                is_failing = False
            except Exception:
                if not is_failing:
                    log.exception("the summary failed")
                is_failing = True

    def _look(self) -> None:
        summary, now_s = robot_summary(self._robot), time.monotonic()
        if summary == self._shown and now_s < self._due_s:
            return
        self._shown, self._due_s = summary, now_s + HEARTBEAT_S
        uptime_s = round(now_s - self._began_s)
        message = {**self._identity, **summary, "uptime_s": uptime_s}
        publish_if_alive(self._publisher, String(data=json.dumps(message)))


def robot_summary(robot: Robot) -> dict[str, Any]:
    """Return what changes in a list of robots, as JSON. Any thread.

    ``state`` is "ready" or one of ``STATES``; ``problems`` are texts, the root cause first;
    ``owners`` names the clients that move axes.
    """
    problems = robot.find_problems()
    kinds = {problem.kind for problem in problems}
    found = next((text for kind, text in STATES.items() if kind in kinds), READY)
    state = found if found != READY or robot.connection.ready else STATES[ProblemKind.DEVICE]
    axes = robot.axes
    owners = {axes.owner(axis) for axis in range(len(axes))} - {""}
    return {
        "state": state,
        "problems": [problem.text for problem in problems[:MAX_PROBLEMS]],
        "owners": sorted(owners),
    }
