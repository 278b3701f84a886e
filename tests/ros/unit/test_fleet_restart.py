"""List of robots when one of them is killed and started again."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import pytest
from std_msgs.msg import String

from robotd_ros.client import fleet
from robotd_ros.client.fleet import SILENCE_S, SILENT, Fleet
from robotd_ros.node_names import SUMMARY


class Domain:
    """Client of a ROS domain in which the test says what is discovered."""

    def __init__(self) -> None:
        self.publishers = 1
        self.receive: Any = None
        self.node = self

    def spin(self) -> None:
        """Nothing is received by itself."""

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        return [(f"/{SUMMARY}", [])]

    def create_subscription(self, kind: Any, topic: str, receive: Any, qos: Any) -> None:
        self.receive = receive

    def count_publishers(self, topic: str) -> int:
        return self.publishers

    def announce(self, pid: int) -> None:
        said = {"robot": "arm", "pid": pid, "state": "ready", "uptime_s": 1.0}
        self.receive(String(data=json.dumps({**said, "problems": [], "owners": []})))


def test_a_robot_that_was_killed_leaves_the_list(monkeypatch: pytest.MonkeyPatch) -> None:
    domain, now_s = Domain(), [100.0]
    monkeypatch.setattr(fleet, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    robots = Fleet(domain)  # type: ignore[arg-type]

    def listed() -> list[tuple[int, str]]:
        robots.update()
        return [(robot.pid, robot.state) for robot in robots.robots]

    assert listed() == []
    domain.announce(1)
    assert listed() == [(1, "ready")]
    now_s[0] += SILENCE_S + 1.0
    domain.publishers = 2  # the killed one is still discovered
    domain.announce(2)
    assert listed() == [(1, SILENT), (2, "ready")]
    now_s[0] += 1.0
    domain.publishers = 1
    domain.announce(2)
    assert listed() == [(2, "ready")]
    now_s[0] += 1.0
    domain.publishers = 0
    assert listed() == []
