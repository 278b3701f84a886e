"""Log lines of lost and returned nodes."""

from __future__ import annotations

from collections.abc import MutableMapping
from types import SimpleNamespace
from typing import Any, cast

import pytest
from structlog.testing import capture_logs

from robotd_canopen.node import Node
from robotd_canopen.outage_log import OutageLog, Return, causes

PERIOD_NS = 4_000_000
Lines = list[MutableMapping[str, Any]]


def nodes(count: int) -> list[Node]:
    return [
        cast(Node, SimpleNamespace(id=number, name=f"node{number}", fault="silent"))
        for number in range(1, count + 1)
    ]


def visible(lines: Lines) -> Lines:
    return [line for line in lines if line["log_level"] != "debug"]


def returns(lines: Lines) -> list[tuple[str, str]]:
    return [(line["log_level"], line["nodes"]) for line in lines]


def test_nodes_lost_together_are_one_line() -> None:
    with capture_logs() as lines:
        OutageLog().lost(nodes(5), reported=False)
    assert [line["log_level"] for line in lines] == ["error"]
    assert lines[0]["reason"] == "node1: silent; node2: silent; node3: silent; and 2 more nodes"
    assert causes(nodes(1)) == "node1: silent"


def test_the_rest_of_a_reported_loss_is_for_debugging() -> None:
    with capture_logs() as lines:
        OutageLog().lost(nodes(1), reported=True)
    assert visible(lines) == []


@pytest.mark.parametrize(("how", "level"), [(Return.RESET, "warning"), (Return.RESUMED, "info")])
def test_nodes_that_return_one_after_the_other_are_one_line(how: Return, level: str) -> None:
    outage = OutageLog()
    with capture_logs() as lines:
        for node in nodes(3):
            outage.came_back(node, how)
            outage.advance(PERIOD_NS, complete=False)
        assert lines == []
        for _ in range(200):
            outage.advance(PERIOD_NS, complete=False)
    assert returns(lines) == [(level, "node1, node2, node3")]


def test_the_last_return_is_reported_at_once() -> None:
    outage = OutageLog()
    with capture_logs() as lines:
        for node in nodes(2):
            outage.came_back(node, Return.RESET)
        outage.advance(PERIOD_NS, complete=True)
    assert returns(lines) == [("warning", "node1, node2")]


def test_a_node_lost_again_has_not_returned() -> None:
    outage = OutageLog()
    with capture_logs() as lines:
        for node in nodes(2):
            outage.came_back(node, Return.RESUMED)
        outage.lost(nodes(1), reported=True)
        outage.advance(PERIOD_NS, complete=True)
    assert returns(visible(lines)) == [("info", "node2")]
