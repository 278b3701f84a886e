"""Time-out of streamed setpoints."""

from __future__ import annotations

from tests.fakes import FakeClock

from robotd_cia402.stream_timeout import StreamTimeout


def test_each_node_that_streams_is_named_once_after_the_limit() -> None:
    clock = FakeClock()
    stream = StreamTimeout(clock, 0.1)
    stream.restart()
    clock.advance(0.1)
    assert stream.problem(clock.now_ns(), ["node 2"]) == ""
    clock.advance(0.001)
    names = ["node 2", "node 2", "node 3"]
    assert stream.problem(clock.now_ns(), names) == "node 2, node 3: no setpoint for 0.1 s"
    assert stream.problem(clock.now_ns(), []) == ""
    assert stream.restart() == clock.now_ns()
    assert stream.problem(clock.now_ns(), names) == ""
