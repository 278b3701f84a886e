"""Observer of a robot: ``/diagnostics``, its problems and its summary, from one look.

One part is the detection of other processes that serve nodes of the same names. ROS allows it
without a word: two robots of one name both receive every command and answer every service.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence
from typing import Self

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from robotd.clock import NANOSECONDS, MonotonicClock
from robotd.log import get_logger
from robotd.robot import Robot
from robotd_ros.diagnostics.part_status import DiagnosticLevel, PartStatus
from robotd_ros.diagnostics.robot_health import Health
from robotd_ros.middleware import NODE_GONE, Participant
from robotd_ros.nodes.operator_node import OperatorNode

log = get_logger("diagnostics")

TOPIC = "/diagnostics"  # absolute: aggregators and monitors of ROS listen there
DEPTH = 10
PERIOD_NS = NANOSECONDS  # 1 Hz
CHECK_PERIOD_S = 0.1  # period of the check for changes
BUS_AGE_S = 0.9  # within which another reader has asked the fieldbus
END_TIMEOUT_S = 1.0  # for a check that is under way
ros_log = get_logger("ros")

PART = "names"
ADVICE = "give each robot a namespace: --ros-args -r __ns:=/NAME"
_TOPIC = "/parameter_events"  # every node publishes it


class Diagnostics:
    """Diagnostics of a process: ``with Diagnostics(nodes, robot, operator):``.

    They go out once a second and on every change. A thread of its own, ``robotd-diagnostics``,
    looks at the robot: reading the fieldbus may block, and so may the driver of a lost device
    that is asked for its reason, which neither the control loop nor the executor can afford.

    Args:
        nodes: all of the process; the first one publishes, and its namespace distinguishes robots
            that share the topic.
        operator: publishes the problems and the summary.
    """

    def __init__(self, nodes: Sequence[Node], robot: Robot, operator: OperatorNode) -> None:
        node = nodes[0]
        self._robot, self._operator = robot, operator
        self._publisher = node.create_publisher(DiagnosticArray, TOPIC, DEPTH)
        self._clock = node.get_clock()
        self._hardware = f"{node.get_namespace()}/{robot.descriptor.name}".lstrip("/")
        self._health = Health(robot)
        self._clash = NameClash(nodes)
        self._clash_status: PartStatus | None = None
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
            unchanged = seen == self._published
            if unchanged and not is_due:
                return
            if is_due:  # on a grid of whole periods, unless one was left out
                self._due_ns = max(self._due_ns + PERIOD_NS, now_ns)
                self._clash_status = self._clash.check()
            self._published = seen
            statuses = self._health.statuses(BUS_AGE_S if unchanged else 0.0)
            self._publish([*statuses, self._clash_status] if self._clash_status else statuses)
            self._failing = False
        except NODE_GONE:
            self._stop.set()  # the node is gone
        except Exception:
            if not self._failing:
                log.exception("the diagnostics failed")
            self._failing = True

    def _publish(self, statuses: list[PartStatus]) -> None:
        message = DiagnosticArray(status=[self._message(status) for status in statuses])
        message.header.stamp = self._clock.now().to_msg()
        self._publisher.publish(message)

    def _message(self, status: PartStatus) -> DiagnosticStatus:
        return DiagnosticStatus(
            level=bytes([status.level]),
            name=f"robotd/{self._hardware}: {status.part}",
            message=status.message,
            hardware_id=self._hardware,
            values=[KeyValue(key=key, value=value) for key, value in status.values.items()],
        )


class NameClash:
    """Compares the names of this process's nodes with the ROS graph. One thread.

    Args:
        nodes: all of this process, at least one; their node graph is asked.
    """

    def __init__(self, nodes: Sequence[Node]) -> None:
        self._node = nodes[0]
        self._names = {node.get_fully_qualified_name() for node in nodes}
        self._known: frozenset[str] = frozenset()
        self._is_logged = False

    def check(self) -> PartStatus | None:
        """Warning while another process has nodes of these names.

        Beginning and end are logged once each, when two checks agree: names come and go one by one
        while processes are discovered.

        Raises InvalidHandle when the node is gone.
        """
        found = self._node.get_node_names_and_namespaces()
        counts = Counter(_full_name(name, namespace) for name, namespace in found)
        doubled = frozenset(name for name in self._names if counts[name] > 1)
        is_settled, self._known = doubled == self._known, doubled
        begins_or_ends = is_settled and bool(doubled) is not self._is_logged
        if begins_or_ends:
            self._is_logged = bool(doubled)
        if not doubled:
            if begins_or_ends:
                ros_log.info("no other process serves nodes of the same names any more")
            return None
        others = " and ".join(self._others(doubled)) or "not known"
        if begins_or_ends:
            names = sorted(doubled)
            ros_log.warning(
                "another process serves nodes of the same names: both obey every command",
                nodes=names,
                other=others,
                advice=ADVICE,
            )
        text = f"another process serves {len(doubled)} nodes of the same names; {ADVICE}"
        return PartStatus(
            PART, DiagnosticLevel.WARN, text, {"other": others, "nodes": " ".join(sorted(doubled))}
        )

    def _others(self, doubled: frozenset[str]) -> list[str]:
        """Descriptions of the other processes, as far as the middleware shows them."""
        participants = {
            participant
            for endpoint in self._node.get_publishers_info_by_topic(_TOPIC)
            if _full_name(endpoint.node_name, endpoint.node_namespace) in doubled
            and (participant := Participant.of(bytes(endpoint.endpoint_gid)))
        }
        own = [participant for participant in participants if participant.is_own]
        own_host = own[0].host if len(own) == 1 else None
        others = participants.difference(own) if own_host is not None else participants
        return sorted(participant.describe(own_host) for participant in others)


def _full_name(name: str, namespace: str) -> str:
    return f"{namespace.rstrip('/')}/{name}"
