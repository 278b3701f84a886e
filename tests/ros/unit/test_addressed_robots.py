"""Find the robots of a namespace, which a command would reach."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any

import pytest
from std_msgs.msg import String

from robotd.errors import DeviceTimeout, OperationError
from robotd_ros.client import fleet
from robotd_ros.client.fleet import OTHERS_S, addressed_robots, read_neighbour
from robotd_ros.client.ros_client import RosClient
from robotd_ros.commands.robot_client import require_one_robot


class Graph:
    """Client and node that discover one robot after the other; no time passes.

    Args:
        robots: messages, each with the time that its robot takes to be discovered, seconds.
    """

    def __init__(self, robots: Sequence[tuple[float, str]]) -> None:
        self.node, self.waited_s = self, 0.0
        self._robots = [*robots]
        self._callback: Callable[[String], None] | None = None

    def create_subscription(self, kind: Any, topic: str, callback: Any, qos: Any) -> None:
        self._callback = callback

    def destroy_subscription(self, subscription: Any) -> None:
        self._callback = None

    def count_publishers(self, topic: str) -> int:
        return sum(after_s <= self.waited_s for after_s, _ in self._robots)

    def wait(self, condition: Callable[[], bool], what: str, timeout_s: float) -> None:
        end_s = self.waited_s + timeout_s
        sent = [message for after_s, message in self._robots if after_s < self.waited_s]
        while not condition():
            for after_s, message in self._robots:
                if after_s <= self.waited_s and message not in sent:
                    sent.append(message)
                    self._callback(String(data=message))
            self.waited_s += 0.01
            if self.waited_s > end_s:
                raise DeviceTimeout(what)


def summary(pid: int, **values: Any) -> str:
    told = {"robot": "arm", "namespace": "/", "backend": "sim", "computer": "here", "pid": pid}
    return json.dumps({**told, **values})


def found(graph: Graph) -> list[int]:
    return [robot.pid for robot in addressed_robots(graph)]


def test_one_robot_is_known_without_a_delay() -> None:
    graph = Graph([(0.05, summary(1, sharing=0))])
    assert found(graph) == [1]
    assert graph.waited_s < 0.1


def test_a_robot_that_is_discovered_later_is_awaited_because_the_other_one_knows_it() -> None:
    graph = Graph([(0.05, summary(1, sharing=1)), (2.0, summary(2, sharing=1))])
    assert found(graph) == [1, 2]


def test_a_robot_that_is_discovered_and_has_not_announced_itself_is_awaited() -> None:
    """As on a busy computer: its summary comes 1.5 s after it was discovered."""

    class Late(Graph):
        def count_publishers(self, topic: str) -> int:
            return 1

    assert found(Late([(1.5, summary(1, sharing=0))])) == [1]


def test_a_robot_that_was_killed_holds_a_command_up_for_some_seconds_only() -> None:
    graph = Graph([(0.05, summary(1, sharing=1))])
    assert found(graph) == [1]
    assert graph.waited_s < OTHERS_S + 2


def test_a_robot_without_the_number_and_another_program_are_taken_as_they_are() -> None:
    assert found(Graph([(0.0, summary(7))])) == [7]
    assert found(Graph([(0.0, "nonsense")])) == [0]
    assert found(Graph([])) == []


def test_robots_that_are_not_discovered_yet_are_looked_for_again_before_the_first_request(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    two = tuple(read_neighbour(summary(pid)) for pid in (1, 2))
    answers = [(), two]
    monkeypatch.setattr(fleet, "addressed_robots", lambda *_: answers.pop(0))
    client = RosClient()
    require_one_robot(client)
    assert client.before_request is not None
    with pytest.raises(OperationError, match="2 robots share this namespace"):
        client.before_request()
