"""Starts with drives whose answers, objects or ids are not those of a plain one."""

from __future__ import annotations

import pytest
from tests.independent.conftest import NODE, START_RAD, OpenBench

from robotd.errors import ConnectError


def fault_of_node(bench: object) -> str:
    return str(bench.robot.fieldbus.status(0).nodes[0].fault)  # type: ignore[attr-defined]


@pytest.mark.parametrize("delay_s", [0.02, 0.1, 0.25])
def test_another_node_with_the_id_that_answers_late(open_bench: OpenBench, delay_s: float) -> None:
    with open_bench(duplicate_delay_s=delay_s) as bench:
        with pytest.raises(ConnectError, match=rf"node {NODE}.*\n?.*duplicate node id"):
            bench.robot.start()
        assert not bench.drive["energised"]


def test_heartbeats_of_two_nodes_are_noticed_in_operation(open_bench: OpenBench) -> None:
    with open_bench() as bench:
        bench.robot.start()
        assert fault_of_node(bench) == ""
        bench.drive.set(heartbeat_copies=2)
        bench.until(lambda: "probably a duplicate node id" in fault_of_node(bench))
        assert bench.robot.connection.ready
        assert bench.image.position[0] == pytest.approx(START_RAD, abs=1e-3)


def test_a_second_node_with_the_id_that_is_connected_in_operation(open_bench: OpenBench) -> None:
    with open_bench() as bench:
        bench.robot.start()
        bench.drive.set(duplicate_delay_s=0.1)
        bench.until(lambda: not bench.robot.connection.ready)  # its boot-up message
        with pytest.raises(ConnectError, match="duplicate node id"):
            bench.robot.recover()
