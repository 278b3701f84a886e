"""Adverse conditions of a computer, made on purpose."""

from __future__ import annotations

import itertools
import os
import struct
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.bench.process import Program

HOURS_NS = 5 * 3600 * 10**9
STEP_S = 0.7


@dataclass(frozen=True)
class Condition:
    """Something that is wrong with the computer.

    Attributes:
        summary: one line for people.
        during: it is so while this is open; called with the folder of the run.
        redirect: of the shell that starts robotd.
        environment: for robotd; called with the folder of the run.
    """

    summary: str
    during: Callable[[Path], AbstractContextManager[Any]] = lambda _: nullcontext()
    redirect: str = ""
    environment: Callable[[Path], dict[str, str]] = lambda _: {}


@contextmanager
def hogs(kind: str, count: int) -> Iterator[None]:
    """``count`` programs of ``tools.endurance.hog`` at once."""
    command = [sys.executable, "-m", "tools.endurance.hog", kind]
    with ExitStack() as stack:
        for _ in range(count):
            stack.enter_context(Program(command, os.environ, started="hogging"))
        yield


@contextmanager
def stepped_clock(folder: Path) -> Iterator[None]:
    """The wall clock of the robot: five hours ahead, five behind, right, and so on."""
    ended = threading.Event()

    def step() -> None:
        with (folder / "offset").open("r+b", buffering=0) as file:
            for offset_ns in itertools.cycle((HOURS_NS, -HOURS_NS, 0)):
                os.pwrite(file.fileno(), struct.pack("q", offset_ns), 0)
                if ended.wait(STEP_S):
                    return

    stepping = threading.Thread(target=step)
    stepping.start()
    try:
        yield
    finally:
        ended.set()
        stepping.join()


def clock_environment(folder: Path) -> dict[str, str]:
    """Builds the library that moves a process's wall clock. Raises CalledProcessError."""
    library, offset = folder / "wall_clock.so", folder / "offset"
    source = Path(__file__).with_name("wall_clock.c")
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", source, "-o", library, "-ldl"], check=True)
    offset.write_bytes(bytes(8))
    return {"LD_PRELOAD": str(library), "WALL_CLOCK_OFFSET_FILE": str(offset)}


CORES = len(os.sched_getaffinity(0))
CONDITIONS = {
    "quiet": Condition("nothing else, for comparison"),
    "cpu": Condition("a busy loop on every core", lambda _: hogs("cpu", CORES)),
    "realtime": Condition(
        "a busy loop on every core, SCHED_RR below the robot", lambda _: hogs("realtime", CORES)
    ),
    "memory": Condition("memory taken and touched all the time", lambda _: hogs("memory", 1)),
    "clock": Condition(
        "wall clock set by hours, to and fro", stepped_clock, environment=clock_environment
    ),
    "log": Condition("disk of the log full", redirect="2>/dev/full"),
    "output": Condition("disk of all output full", redirect="1>/dev/full 2>/dev/full"),
}
