"""Names of clients in the graph, also of those that have gone."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from robotd_ros import senders
from robotd_ros.senders import Senders

GUID = bytes(range(16))


class Graph:
    """Stand-in of a node: one publisher of each topic."""

    def __init__(self, name: str) -> None:
        self.name = name

    def get_publishers_info_by_topic(self, topic: str) -> list[Any]:
        namespace = "_NODE_NAMESPACE_UNKNOWN_" if self.name == senders.UNKNOWN else "/cell"
        return [
            SimpleNamespace(
                node_name=self.name, node_namespace=namespace, endpoint_gid=[*GUID[:12], *b"1234"]
            )
        ]


@pytest.fixture(autouse=True)
def request_id(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(senders, "request_id_of", lambda _: SimpleNamespace(guid=[*GUID]))


def test_a_client_has_the_name_of_its_node() -> None:
    assert Senders(Graph("planner")).of_request(None) == "/cell/planner"  # type: ignore[arg-type]


def test_a_client_that_has_gone_has_a_number_until_its_name_is_known() -> None:
    graph = Graph(senders.UNKNOWN)
    found = Senders(graph)  # type: ignore[arg-type]
    assert found.of_request(None) == "unnamed client 000102030405060708090a0b"
    assert found.of_topic("/cmd_vel") == ""
    graph.name = "planner"
    assert found.of_request(None) == "/cell/planner"
