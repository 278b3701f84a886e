"""The process around the backend: it belongs to robotd and stays as it is."""

from __future__ import annotations

import gc
import os
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable
from contextlib import nullcontext, suppress
from pathlib import Path

import numpy as np
import pytest

from robotd.api import ProcessImage
from robotd_conformance.checks.harness import Harness, MakeHarness
from robotd_conformance.checks.surroundings import surroundings
from robotd_conformance.checks.test_leaks import allocated_bytes

OWN_LOG = "component="
STANDARD_ERROR = 2  # its file descriptor
READS, SPANS, OBJECTS_PER_READ = 100, 8, 0.5
# A list grows by leaps: one of them is not in all windows.
ROOM_READS, ROOM_SPANS, WINDOW, BYTES_PER_READ = 60, 8, 3, 6.0


def hooks() -> dict[str, object]:
    return {
        "exception hooks": (sys.excepthook, threading.excepthook),
        "standard streams": (sys.stdout, sys.stderr),
        "warning filters": list(warnings.filters),
        "random numbers": np.random.get_state(legacy=False)["state"]["pos"],  # noqa: NPY002 - shared by all
    }


@pytest.mark.clause("backend/process")
def test_it_is_left_as_it_is(
    make_harness: MakeHarness,
    at_start: dict[str, object],
    capfd: pytest.CaptureFixture[str],
) -> None:
    before = at_start | hooks()
    harness = make_harness()
    harness.start()
    harness.move_all(0.2)
    harness.rest()
    during = surroundings() | hooks()
    harness.stop()
    for seen in (during, surroundings() | hooks()):
        assert [name for name in before if seen[name] != before[name]] == []
    said = capfd.readouterr()
    foreign = [line for line in said.out.splitlines() if line and OWN_LOG not in line]
    assert foreign == [], "standard output belongs to the program"


@pytest.mark.clause("DeviceDriver.close/disconnects")
def test_closing_takes_no_time(fresh: Harness) -> None:
    device = fresh.drivers.device
    device.stop_communication(5.0)
    began_ns = fresh.clock.now_ns()
    began_s = time.perf_counter()
    device.close()
    assert time.perf_counter() - began_s < 3.0, "close() takes more than 3 s"
    assert (fresh.clock.now_ns() - began_ns) * 1e-9 < 3.0


@pytest.mark.clause("DeviceDriver.state/now")
@pytest.mark.clause("drivers/loop")
def test_reading_needs_no_memory(fresh: Harness) -> None:

    def growth() -> float:
        """Return the objects that the process gains per read of the control loop."""
        before = living_objects()
        fresh.periods(READS)
        return (living_objects() - before) / READS

    growth()  # what only the start needed is freed
    # The device's threads make objects, too, and on a busy computer use them late. They do not do
    # so in every span, as a leak does.
    grown = [growth()]
    while min(grown) > OBJECTS_PER_READ and len(grown) < SPANS:
        grown.append(growth())
    assert min(grown) <= OBJECTS_PER_READ, f"a read leaves {min(grown):.1f} objects behind"


@pytest.mark.clause("drivers/loop")
@pytest.mark.parametrize("streams", [False, True], ids=["read", "stream"])
def test_a_period_needs_no_room(fresh: Harness, streams: bool) -> None:
    """Also in lists and buffers that grow without a further object."""
    position, velocity = fresh.image.position_command.copy(), np.zeros(fresh.count)
    streams = streams and not fresh.robot.axes.trajectories_on_device
    claim = fresh.robot.axes.claimed("conformance", fresh.all) if streams else nullcontext()
    grown, before = list[float](), allocated_bytes()

    def send(image: ProcessImage) -> None:
        if streams:
            fresh.stream(position, velocity)

    with claim, fresh.each_period(send):
        for _ in range(ROOM_SPANS):
            fresh.periods(ROOM_READS)
            gc.collect()
            now = allocated_bytes()
            grown.append((now - before) / ROOM_READS)
            before = now
    windows = [sum(grown[first : first + WINDOW]) / WINDOW for first in range(1, len(grown) - 2)]
    assert min(windows) <= BYTES_PER_READ, f"a period leaves {min(windows):.1f} bytes behind"


def living_objects() -> int:
    gc.collect()
    return sys.getallocatedblocks()


@pytest.mark.clause("backend/fork")
def test_a_forked_process_does_not_disturb_the_device(fresh: Harness) -> None:
    start = fresh.image.position_command.copy()
    assert in_a_fork(lambda: None) == ""
    fresh.pass_time(0.2)
    assert fresh.robot.connection.ready, "a fork has ended the communication"
    assert fresh.image.servo_on.all(), "a fork has switched servos off"
    fresh.move(fresh.all, start + fresh.travel(0.2))
    fresh.rest()
    assert not fresh.off_target(start + fresh.travel(0.2))


@pytest.mark.clause("backend/fork")
def test_a_device_can_be_opened_after_a_fork(unopened: Harness) -> None:

    def use() -> None:
        unopened.start(enable=False)
        assert np.isfinite(unopened.image.position).all()
        unopened.stop()

    failure = in_a_fork(use)
    assert failure == "", (
        f"the device that was made before a fork cannot be used after it: {failure}"
    )


@pytest.mark.clause("backend/process")
def test_programs_inherit_no_handle(make_harness: MakeHarness) -> None:
    before = inherited_handles()
    make_harness().start(enable=False)
    left = inherited_handles() - before
    assert not left, "a program that robotd starts would hold the device open"


def in_a_fork(work: Callable[[], None]) -> str:
    """Run ``work`` in a forked process; return its traceback, "" without one."""
    reader, writer = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # threads of others are not forked
        child = os.fork()
    if child == 0:
        try:
            work()
        except BaseException:  # noqa: BLE001 - reported to the parent
            os.write(writer, traceback.format_exc()[-2000:].encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, encoding="utf-8") as report:
        failure = report.read()
    os.waitpid(child, 0)
    return failure


def inherited_handles() -> set[str]:
    """Return the targets of the handles that a program gets which is started now."""
    found = set[str]()
    for link in Path("/proc/self/fd").iterdir():
        with suppress(OSError):  # the handle of this very listing
            if int(link.name) > STANDARD_ERROR and os.get_inheritable(int(link.name)):
                found.add(str(link.readlink()))
    return found
