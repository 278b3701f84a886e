"""No thread, no handle, no process is left behind."""

from __future__ import annotations

import ctypes
import gc
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from robotd.api import MonotonicClock, wait_until
from robotd_conformance.checks.harness import Harness, MakeHarness

ROUNDS = 3
STARTS, BLOCKS_PER_START = 3, 40.0
BYTES_PER_START = 8192.0  # the events of a start, which the core keeps, take 3300
BLOCKS_PER_AXIS = 12.0  # the event of its servo off, which the core keeps too, has 10


def run_once(make_harness: MakeHarness) -> None:
    harness = make_harness()
    harness.start()
    harness.move_all(0.1)
    harness.rest()
    harness.stop()


def settles(condition: Callable[[], bool]) -> bool:
    """Return True when ``condition`` becomes true within a time-out."""
    return wait_until(condition, 2.0, MonotonicClock(), 0.02)


@pytest.mark.clause("AxisDriver.clear_alarm/clears")
@pytest.mark.clause("DeviceDriver.open/connects")
def test_no_thread_is_left(make_harness: MakeHarness) -> None:
    make_harness()
    before = set(threading.enumerate())
    for _ in range(ROUNDS):
        run_once(make_harness)

    def left() -> list[str]:
        return [thread.name for thread in threading.enumerate() if thread not in before]

    assert settles(lambda: not left()), f"threads left behind: {left()}"


@pytest.mark.clause("DeviceDriver.close/disconnects", "DeviceDriver.stop_communication/ends")
@pytest.mark.clause("DeviceDriver.open/connects")
def test_no_handle_is_left(make_harness: MakeHarness) -> None:
    folder = Path("/proc/self/fd")
    run_once(make_harness)  # what is opened once for the process, such as a log, may stay

    def handles() -> dict[str, str]:
        gc.collect()
        found = {}
        for link in list(folder.iterdir()):
            with suppress(FileNotFoundError):  # the handle of this very listing
                found[link.name] = str(link.readlink())
        return found

    before = handles()
    for _ in range(ROUNDS):
        run_once(make_harness)
    enough = settles(lambda: len(handles()) <= len(before))
    left = [target for name, target in handles().items() if name not in before]
    assert enough, f"handles left behind: {left}"


@pytest.mark.clause("DeviceDriver.close/disconnects")
def test_no_process_is_left(make_harness: MakeHarness) -> None:
    def children() -> set[str]:
        found: set[str] = set()
        for task in Path("/proc/self/task").glob("*/children"):
            with suppress(FileNotFoundError, ProcessLookupError):  # the thread has ended meanwhile
                found.update(task.read_text(encoding="ascii").split())
        return found

    before = children()
    run_once(make_harness)
    assert settles(lambda: children() <= before), f"processes left behind: {children() - before}"


@pytest.mark.clause(
    "DeviceDriver.start_communication/starts",
    "DeviceDriver.open/connects",
    "DeviceDriver.stop_communication/ends",
)
@pytest.mark.parametrize("close", [True, False], ids=["closed", "stopped"])
def test_nothing_grows_with_each_start(unopened: Harness, close: bool) -> None:
    """Threads, handles and memory, of one device that is started again and again."""

    def restart() -> None:
        unopened.robot.connection.start()
        unopened.until(lambda: unopened.robot.connection.ready, "the engine is ready")
        unopened.periods(3)
        if close:
            unopened.robot.connection.close()
        else:
            unopened.robot.connection.stop_communication()
        unopened.periods(3)

    unopened.begin()
    check_growth(restart, "start", BLOCKS_PER_START + BLOCKS_PER_AXIS * unopened.count)


@pytest.mark.clause("drivers/loop", "AxisDriver.move/starts", "AxisDriver.clear_alarm/clears")
@pytest.mark.clause("AxisDriver.stop/rests")
def test_nothing_grows_with_each_command(harness: Harness) -> None:
    """Checks the driver alone: the core keeps a history of commands."""
    start, travel = harness.image.position_command.copy(), harness.travel(0.1)
    driver = harness.plugin_axes
    profiles = [harness.profile(axis) for axis in harness.all]

    def command() -> None:
        for axis in harness.all:
            driver.move(axis, float(start[axis] + travel[axis]), profiles[axis])
        harness.periods(5)
        driver.stop(harness.all)
        driver.quick_stop(harness.all)
        harness.rest()
        for axis in harness.all:
            driver.clear_alarm(axis, 5.0)
            driver.servo(axis, True, 5.0)
            driver.move(axis, float(start[axis]), profiles[axis])
        harness.rest()

    check_growth(command, "round of commands")


def check_growth(work: Callable[[], None], what: str, max_blocks: float = BLOCKS_PER_START) -> None:
    """Fail where threads, handles or memory grow with each ``work``."""

    def size() -> np.ndarray:
        gc.collect()
        handles = len(list(Path("/proc/self/fd").iterdir()))
        blocks = sys.getallocatedblocks()
        return np.array([threading.active_count(), handles, blocks, allocated_bytes()])

    for _ in range(2):
        work()  # what is made once may stay
    sizes = [size()]
    for _ in range(2 * STARTS):
        work()
        sizes.append(size())
    grown = np.diff(np.array(sizes, np.float64), axis=0)
    threads, handles = grown[:, :2].sum(0)
    blocks, octets = np.median(grown[:, 2:], axis=0)
    assert threads < STARTS, f"{threads:.0f} threads more after {2 * STARTS} times"
    assert handles < STARTS, f"{handles:.0f} handles more after {2 * STARTS} times"
    assert blocks <= max_blocks, f"each {what} leaves {blocks:.0f} objects behind"
    assert octets <= BYTES_PER_START, f"each {what} leaves {octets:.0f} bytes behind"


class _Mallinfo2(ctypes.Structure):
    """``struct mallinfo2`` of glibc's malloc.h."""

    _fields_ = [
        *((name, ctypes.c_size_t) for name in ("arena", "ordblks", "smblks", "hblks", "hblkhd")),
        *((name, ctypes.c_size_t) for name in ("usmblks", "fsmblks", "uordblks", "fordblks")),
        ("keepcost", ctypes.c_size_t),
    ]


def allocated_bytes() -> int:
    """Return the bytes that malloc has given out: all but Python's objects of at most 512 bytes.

    Unlike tracemalloc it does not slow down a driver, whose peer may be in this process.
    0 where the C library cannot tell (before glibc 2.33, musl).
    """
    try:
        mallinfo2 = ctypes.CDLL(None).mallinfo2
    except AttributeError:
        return 0
    mallinfo2.restype = _Mallinfo2
    found = mallinfo2()
    return int(found.uordblks + found.hblkhd)
