"""Publisher of ``/diagnostics``, once a second and on every change, and of the problems."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Self

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from robotd.clock import NANOSECONDS, MonotonicClock
from robotd.log import get_logger
from robotd.robot import Robot
from robotd_ros.diagnostics.name_clash import NameClash
from robotd_ros.diagnostics.part_status import Status
from robotd_ros.diagnostics.robot_health import Health
from robotd_ros.middleware import NODE_GONE
from robotd_ros.nodes.operator_node import OperatorNode

log = get_logger("diagnostics")

TOPIC = "/diagnostics"  # absolute: aggregators and monitors of ROS listen there
DEPTH = 10
PERIOD_NS = NANOSECONDS  # 1 Hz
CHECK_PERIOD_S = 0.1  # period of the check for changes
END_TIMEOUT_S = 1.0  # for a check that is under way


class Diagnostics:
    """Diagnostics of a process: ``with Diagnostics(nodes, robot, operator):``.

    A thread of its own, ``robotd-diagnostics``, does it: reading the fieldbus may block, which
    neither the control loop nor the executor can afford.

    Args:
        nodes: all of the process; the first one publishes, and its namespace distinguishes robots
            that share the topic.
        operator: publishes the problems.
    """

    def __init__(self, nodes: Sequence[Node], robot: Robot, operator: OperatorNode) -> None:
        node = nodes[0]
        self._robot, self._operator = robot, operator
        self._publisher = node.create_publisher(DiagnosticArray, TOPIC, DEPTH)
        self._clock = node.get_clock()
        self._hardware = f"{node.get_namespace()}/{robot.descriptor.name}".lstrip("/")
        self._health = Health(robot)
        self._clash = NameClash(nodes)
        self._clash_status: Status | None = None
        self._published: object = None
        self._due_ns = 0
        self._failing = False
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="robotd-diagnostics", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Publish the last state, too."""
        self._stop.set()
        self._thread.join(END_TIMEOUT_S)
        if not self._thread.is_alive():
            self._check()

    def _run(self) -> None:
        _ = self._robot.backend.code_tables  # imported now, not at the first alarm
        self._check()
        while not self._stop.wait(CHECK_PERIOD_S):
            self._check()

    def _check(self) -> None:
        """Publish if it is time to, or if something changed. What fails is logged once."""
        try:
            self._operator.publish_problems(self._robot.find_problems())
            now_ns = MonotonicClock.now_ns()
            seen = self._health.fingerprint()
            is_due = now_ns >= self._due_ns
            if seen == self._published and not is_due:
                return
            if is_due:  # on a grid of whole periods, unless one was left out
                self._due_ns = max(self._due_ns + PERIOD_NS, now_ns)
                self._clash_status = self._clash.check()
            self._published = seen
            statuses = self._health.statuses()
            self._publish([*statuses, self._clash_status] if self._clash_status else statuses)
            self._failing = False
        except NODE_GONE:
            self._stop.set()  # the node is gone
        except Exception:
            if not self._failing:
                log.exception("the diagnostics failed")
            self._failing = True

    def _publish(self, statuses: list[Status]) -> None:
        message = DiagnosticArray(status=[self._message(status) for status in statuses])
        message.header.stamp = self._clock.now().to_msg()
        self._publisher.publish(message)

    def _message(self, status: Status) -> DiagnosticStatus:
        return DiagnosticStatus(
            level=bytes([status.level]),
            name=f"robotd/{self._hardware}: {status.part}",
            message=status.message,
            hardware_id=self._hardware,
            values=[KeyValue(key=key, value=value) for key, value in status.values.items()],
        )
