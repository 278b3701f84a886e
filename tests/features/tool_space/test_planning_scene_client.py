"""Requests of MoveIt's planning scene: when, how often, and what is logged."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest
import structlog

pytest.importorskip("rclpy", reason="no ROS in this environment")

from moveit_msgs.srv import GetPlanningScene
from rclpy.task import Future

from robotd_tool_space.nodes import planning_scene_client
from robotd_tool_space.nodes.planning_scene_client import (
    MAX_REQUESTS,
    TIMEOUT_S,
    PlanningSceneClient,
)


class Graph:
    """The ROS side of a client, with servers and publishers that come and go.

    Attributes:
        servers: names, of the service; the others publish on the topic alone.
        publishers: likewise.
        requests: futures of the responses.
        ended: number of these that are done or cancelled.
    """

    topic_name = "/arm/monitored_planning_scene"
    service_name = "/arm/get_planning_scene"
    callback_guard = staticmethod(nullcontext)

    def __init__(self) -> None:
        self.servers: set[str] = set()
        self.publishers: set[str] = set()
        self.requests: list[Future] = []
        self.ended = 0
        self.check: Callable[[], None]
        host: Any = self
        self.client = PlanningSceneClient(host, host, host, self.requests.append, self._end)

    def _end(self) -> None:
        self.ended += 1

    def create_client(self, kind: type, name: str) -> Any:
        assert (kind, name) == (GetPlanningScene, self.service_name)
        return self

    def create_timer(self, period_s: float, check: Callable[[], None], clock: Any) -> None:
        assert period_s >= 1.0
        self.check = check

    def service_is_ready(self) -> bool:
        return bool(self.servers)

    def get_publishers_info_by_topic(self, topic: str, no_mangle: bool = False) -> list[Any]:
        assert topic == ("rr/arm/get_planning_sceneReply" if no_mangle else self.topic_name)
        found = self.servers if no_mangle else self.publishers
        return [SimpleNamespace(endpoint_gid=[*topic.encode(), *name.encode()]) for name in found]

    def call_async(self, request: Any) -> Future:
        return Future()

    def checks(self, count: int) -> int:
        """Check so often; the number of requests so far."""
        for _ in range(count):
            self.check()
        return len(self.requests)


@pytest.fixture
def graph() -> Graph:
    return Graph()


def test_nothing_is_requested_of_an_absent_server(graph: Graph) -> None:
    graph.publishers = {"other"}
    assert graph.checks(20) == 0


def test_one_request_at_the_second_sight_of_a_server(graph: Graph) -> None:
    graph.servers = {"a"}
    assert graph.checks(1) == 0
    assert graph.checks(1) == 1
    assert graph.checks(20) == 1, "one is pending"
    graph.requests[0].set_result(GetPlanningScene.Response())
    assert graph.ended == 1
    assert graph.checks(20) == 1


@pytest.mark.parametrize("changed", ["servers", "publishers"])
def test_a_new_publisher_is_a_new_server_and_one_that_goes_is_none(
    graph: Graph, changed: str
) -> None:
    graph.servers = graph.publishers = {"a"}
    assert graph.checks(2) == 1
    graph.requests[0].set_result(GetPlanningScene.Response())
    setattr(graph, changed, {"a", "b"})
    assert graph.checks(2) == 2
    graph.requests[1].set_result(GetPlanningScene.Response())
    setattr(graph, changed, {"b"})
    assert graph.checks(20) == 2


def test_a_server_that_comes_back_is_a_new_one(graph: Graph) -> None:
    """As with a middleware that does not name it."""
    graph.servers = {"a"}
    assert graph.checks(2) == 1
    graph.requests[0].set_result(GetPlanningScene.Response())
    graph.servers = set()
    graph.checks(1)
    graph.servers = {"a"}
    assert graph.checks(20) == 2


def test_a_server_that_does_not_respond_is_given_up_with_one_warning(
    graph: Graph, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 0.0
    clock = SimpleNamespace(monotonic=lambda: now_s)
    monkeypatch.setattr(planning_scene_client, "time", clock)
    graph.servers = {"a"}
    with structlog.testing.capture_logs() as logs:
        for _ in range(100):
            now_s += 0.25 * TIMEOUT_S
            graph.check()
    assert len(graph.requests) == graph.ended == MAX_REQUESTS
    assert all(request.cancelled() for request in graph.requests)
    (entry,) = logs
    assert entry["log_level"] == "warning"
    assert entry["service"] == graph.service_name


def test_a_response_that_cannot_be_applied_yet_is_requested_anew(graph: Graph) -> None:
    graph.servers = {"a"}
    for count in range(1, 10):  # more than are left without a response
        assert graph.checks(2) == count
        graph.requests[-1].set_result(GetPlanningScene.Response())
        graph.client.repeat()
