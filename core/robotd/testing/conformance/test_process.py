"""The process around the backend: it belongs to robotd and stays as it is."""

from __future__ import annotations

import sys
import threading
import time
import tracemalloc

import pytest

from robotd.testing.conformance.harness import MakeHarness
from robotd.testing.conformance.surroundings import surroundings

OWN_LOG = "component="
READS, GROWTH_BYTES = 300, 30_000


def hooks() -> dict[str, object]:
    return {
        "exception hooks": (sys.excepthook, threading.excepthook),
        "standard streams": (sys.stdout, sys.stderr),
    }


def test_it_is_left_as_it_is(
    make_harness: MakeHarness,
    at_start: dict[str, object],
    capfd: pytest.CaptureFixture[str],
) -> None:
    before = at_start | hooks()
    harness = make_harness()
    harness.up()
    harness.move(harness.all, harness.image.position_command + harness.travel(0.2))
    harness.rest()
    during = surroundings() | hooks()
    harness.down()
    for seen in (during, surroundings() | hooks()):
        assert [name for name in before if seen[name] != before[name]] == []
    said = capfd.readouterr()
    foreign = [line for line in said.out.splitlines() if line and OWN_LOG not in line]
    assert foreign == [], "standard output belongs to the program"


def test_closing_takes_no_time(make_harness: MakeHarness) -> None:
    harness = make_harness()
    harness.up()
    device = harness.drivers.device
    device.stop_communication(5.0)
    began_ns = harness.clock.now_ns()
    began_s = time.perf_counter()
    device.close()
    assert time.perf_counter() - began_s < 3.0, "close() takes more than 3 s"
    assert (harness.clock.now_ns() - began_ns) * 1e-9 < 3.0


def test_reading_needs_no_memory(make_harness: MakeHarness) -> None:
    harness = make_harness()
    harness.up()

    def growth() -> int:
        before = tracemalloc.get_traced_memory()[0]
        harness.periods(READS)  # the control loop reads
        return tracemalloc.get_traced_memory()[0] - before

    tracemalloc.start()
    try:
        # Threads of the device allocate too, and free it again: each span has to grow.
        assert min(growth() for _ in range(3)) < GROWTH_BYTES, "a read leaves memory behind"
    finally:
        tracemalloc.stop()
