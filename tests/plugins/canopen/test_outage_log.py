"""Log lines of lost and returned nodes."""

from __future__ import annotations

from collections.abc import MutableMapping
from types import SimpleNamespace
from typing import Any, cast

import pytest
from structlog.testing import capture_logs

from robotd_canopen.node import Node
from robotd_canopen.supervision import OutageLog, Return, causes

PERIOD_NS = 4_000_000
Lines = list[MutableMapping[str, Any]]


def nodes(count: int) -> list[Node]:
    return [
        cast(Node, SimpleNamespace(number=number, name=f"node{number}", fault="silent"))
        for number in range(1, count + 1)
    ]


def visible(lines: Lines) -> Lines:
    return [line for line in lines if line["log_level"] != "debug"]


def returns(lines: Lines) -> list[tuple[str, str]]:
    return [(line["log_level"], line["nodes"]) for line in lines]


def test_causes_of_nodes_lost_together_are_one_text() -> None:
    assert causes(nodes(5)) == "node1: silent; node2: silent; node3: silent; and 2 more nodes"
    assert causes(nodes(1)) == "node1: silent"


def test_a_loss_is_left_to_the_core_to_report() -> None:
    with capture_logs() as lines:
        OutageLog().lost(nodes(1))
    assert visible(lines) == []


@pytest.mark.parametrize(
    ("how", "expected"),
    [(Return.RESET, [("warning", "node1, node2, node3")]), (Return.RESUMED, [])],
)
def test_nodes_that_return_without_configuration_are_one_line(
    how: Return, expected: list[tuple[str, str]]
) -> None:
    outage = OutageLog()
    with capture_logs() as lines:
        for node in nodes(3):
            outage.came_back(node, how)
            outage.advance(PERIOD_NS, complete=False)
        assert lines == []
        for _ in range(200):
            outage.advance(PERIOD_NS, complete=False)
    assert returns(visible(lines)) == expected


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
            outage.came_back(node, Return.RESET)
        outage.lost(nodes(1))
        outage.advance(PERIOD_NS, complete=True)
    assert returns(visible(lines)) == [("warning", "node2")]
