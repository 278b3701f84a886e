"""No thread, no handle, no process is left behind."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from robotd.clock import MonotonicClock, wait_until
from robotd_conformance.checks.harness import MakeHarness

ROUNDS = 3


def run_once(make_harness: MakeHarness) -> None:
    harness = make_harness()
    harness.start()
    harness.move_all(0.1)
    harness.rest()
    harness.stop()


def settles(condition: Callable[[], bool]) -> bool:
    """Return True when ``condition`` becomes true within a time-out."""
    return wait_until(condition, 2.0, MonotonicClock(), 0.02)


def test_no_thread_is_left(make_harness: MakeHarness) -> None:
    make_harness()
    before = set(threading.enumerate())
    for _ in range(ROUNDS):
        run_once(make_harness)

    def left() -> list[str]:
        return [thread.name for thread in threading.enumerate() if thread not in before]

    assert settles(lambda: not left()), f"threads left behind: {left()}"


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


def test_no_process_is_left(make_harness: MakeHarness) -> None:
    def children() -> set[str]:
        tasks = Path("/proc/self/task").glob("*/children")
        return {pid for task in tasks for pid in task.read_text(encoding="ascii").split()}

    before = children()
    run_once(make_harness)
    assert settles(lambda: children() <= before), f"processes left behind: {children() - before}"
