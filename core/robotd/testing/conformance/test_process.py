"""The process around the backend: it belongs to robotd and stays as it is."""

from __future__ import annotations

import gc
import sys
import threading
import time

import pytest

from robotd.testing.conformance.harness import MakeHarness
from robotd.testing.conformance.surroundings import surroundings

OWN_LOG = "component="
READS, SPANS, OBJECTS_PER_READ = 100, 10, 0.5


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

    def growth() -> float:
        """Return the objects that the process gains per read of the control loop."""
        before = living_objects()
        harness.periods(READS)
        return (living_objects() - before) / READS

    # The device's threads make objects, too, and on a busy computer use them late. They do not do
    # so in every span, as a leak does.
    grown = [growth()]
    while min(grown) > OBJECTS_PER_READ and len(grown) < SPANS:
        grown.append(growth())
    assert min(grown) <= OBJECTS_PER_READ, f"a read leaves {min(grown):.1f} objects behind"


def living_objects() -> int:
    gc.collect()
    return sys.getallocatedblocks()
