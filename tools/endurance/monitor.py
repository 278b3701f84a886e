"""Monitor of the soak run, once a second: process, diagnostics, joint states."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from tests.ros.robot_process import Client

JOINTS = "/joint_states"


@dataclass(frozen=True)
class CycleLook:
    """Diagnostics of the control loop.

    Attributes:
        at_s: monotonic time at which it came.
        periods, missed: since the start of the robot.
        lateness_p50_us, lateness_p99_us, lateness_max_us: of the last 8192 periods.
        level: of the diagnostics: 0 OK, 1 WARN, 2 ERROR.
    """

    at_s: float
    periods: int
    missed: int
    lateness_p50_us: float
    lateness_p99_us: float
    lateness_max_us: float
    level: int


class Monitor:
    """Keeps the newest of each; callbacks run in the client's thread.

    Attributes:
        first, newest: of the cycle; None before they came.
        joint_states: how many came.
        worst: the highest level that each part of the robot had, by its name.
    """

    def __init__(self, client: Client) -> None:
        self.first: CycleLook | None = None
        self.newest: CycleLook | None = None
        self.joint_states = 0
        self.worst: dict[str, int] = {}
        node = client.node
        node.create_subscription(DiagnosticArray, "/diagnostics", self._diagnosed, 10)
        node.create_subscription(JointState, JOINTS, self._count, qos_profile_sensor_data, raw=True)

    def _count(self, _: bytes) -> None:
        self.joint_states += 1

    def _diagnosed(self, message: Any) -> None:
        for status in message.status:
            part = status.name.partition(": ")[2]
            level = status.level[0]
            self.worst[part] = max(level, self.worst.get(part, 0))
            if part == "cycle":
                values = {value.key: value.value for value in status.values}
                self.newest = cycle_look(values, level)
                self.first = self.first or self.newest


def cycle_look(values: dict[str, str], level: int) -> CycleLook:
    """From the values of the part ``cycle`` of the diagnostics."""
    return CycleLook(
        time.monotonic(),
        int(values["periods"]),
        int(values["missed deadlines"]),
        float(values["lateness p50 (µs)"]),
        float(values["lateness p99 (µs)"]),
        float(values["lateness max (µs)"]),
        level,
    )
