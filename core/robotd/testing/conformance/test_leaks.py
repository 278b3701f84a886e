"""No thread, no handle, no process is left behind."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from robotd.clock import MonotonicClock, wait_until
from robotd.testing.conformance.rig import MakeRig

ROUNDS = 3


def run_once(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.up()
    rig.move(rig.all, rig.image.position_command + rig.travel(0.1))
    rig.rest()
    rig.down()


def settles(condition: Callable[[], bool]) -> bool:
    """Whether ``condition`` comes true: threads and sockets may take a moment to go."""
    return wait_until(condition, 2.0, MonotonicClock(), 0.02)


def test_no_thread_is_left(make_rig: MakeRig) -> None:
    make_rig()
    before = set(threading.enumerate())
    for _ in range(ROUNDS):
        run_once(make_rig)

    def left() -> list[str]:
        return [thread.name for thread in threading.enumerate() if thread not in before]

    assert settles(lambda: not left()), f"threads left behind: {left()}"


def test_no_handle_is_left(make_rig: MakeRig) -> None:
    folder = Path("/proc/self/fd")
    run_once(make_rig)  # what is opened once for the process, such as a log, may stay

    def handles() -> dict[str, str]:
        gc.collect()
        found = {}
        for link in list(folder.iterdir()):
            with suppress(FileNotFoundError):  # the handle of this very listing
                found[link.name] = str(link.readlink())
        return found

    before = handles()
    for _ in range(ROUNDS):
        run_once(make_rig)
    enough = settles(lambda: len(handles()) <= len(before))
    left = [target for name, target in handles().items() if name not in before]
    assert enough, f"handles left behind: {left}"


def test_no_process_is_left(make_rig: MakeRig) -> None:
    def children() -> set[str]:
        tasks = Path("/proc/self/task").glob("*/children")
        return {pid for task in tasks for pid in task.read_text(encoding="ascii").split()}

    before = children()
    run_once(make_rig)
    assert settles(lambda: children() <= before), f"processes left behind: {children() - before}"
