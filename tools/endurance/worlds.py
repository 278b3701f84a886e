"""Drives that outlive robotd: in a process of their own, looked at without robotd."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.plugins.canopen.bus.drives_process import DrivesProcess, write_robot
from tools.endurance.rest import Position

from robotd_ethercat.slaves_process import SlavesProcess

WMX_TESTS = Path(__file__).parents[2] / "plugins" / "wmx" / "tests"


@dataclass(frozen=True)
class World:
    """Drives and what to give to ``robotd run`` for them.

    Attributes:
        robot, backend: of ``robotd run``.
        watchdog_s: after which the drives know by themselves that nobody leads them.
        braking_s: the most that they need from then to standstill.
        arguments: more of ``robotd run``.
        look: called with the process id of robotd, before it is killed; what it returns tells the
            position of the first axis in the drive's units, or None when the engine is gone, and
            every axis with it.
    """

    robot: str
    backend: str
    watchdog_s: float
    braking_s: float
    look: Callable[[int], Position]
    arguments: Sequence[str] = ()


@contextmanager
def canopen_world(folder: Path) -> Iterator[World]:
    """The simulated CiA 402 drives of the arm, over UDP multicast."""
    watchdog_s = 0.5
    robot = write_robot(folder, heartbeat_timeout_s=watchdog_s)
    with DrivesProcess() as drives, drives.observed() as drive:
        yield World(str(robot), "canopen", watchdog_s, braking_s=1.0, look=lambda _: drive.position)


@contextmanager
def ethercat_world() -> Iterator[World]:
    """Simulated EtherCAT slaves of the arm, on a virtual cable of this computer. Needs root."""
    watchdog_s, ends = 0.5, ("robotd-kill0", "robotd-kill1")
    options = f"simulated=false interface={ends[0]} watchdog_ms={1000 * watchdog_s:g}".split()
    arguments = [word for option in options for word in ("--set", f"backends.ethercat.{option}")]
    _ip("link", "add", ends[0], "type", "veth", "peer", "name", ends[1])
    try:
        for end in ends:
            _ip("link", "set", end, "up")
        with SlavesProcess(["--robot", "cr3a", "--interface", ends[1]]) as slaves:

            def position() -> float:
                return float(slaves.inject("0 position"))

            yield World("cr3a", "ethercat", watchdog_s, 1.0, lambda _: position, arguments)
    finally:
        _ip("link", "delete", ends[0])


@contextmanager
def wmx_world() -> Iterator[World]:
    """The WMX backend on the stand-in for its SDK, whose engine is a process of its own."""
    build = [sys.executable, str(WMX_TESTS / "standin_build.py")]
    site = Path(subprocess.run(build, check=True, capture_output=True, text=True).stdout.strip())
    program = str(site.parent / "standin" / "sdk" / "bin" / "standin-port")
    engines: list[dict[str, str]] = []

    def tell(engine: dict[str, str], command: str) -> str:
        result = subprocess.run(
            [program, command], env=engine, check=True, capture_output=True, text=True
        )
        return result.stdout

    def look(pid: int) -> Position:
        entries = Path(f"/proc/{pid}/environ").read_text(encoding="utf-8").split("\0")
        engines.append(dict(entry.split("=", 1) for entry in entries if "=" in entry))
        return lambda: _position(tell(engines[-1], "show"))

    before = os.environ.get("PYTHONPATH", "")
    os.environ["PYTHONPATH"] = f"{site}:{before}" if before else str(site)
    try:
        yield World("cr3a", "wmx", watchdog_s=1.0, braking_s=1.0, look=look)
    finally:
        os.environ["PYTHONPATH"] = before
        for engine in engines:
            tell(engine, "reset")
            Path("/dev/shm", engine["WMX_STANDIN_SHM"]).unlink(missing_ok=True)


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True)


def _position(shown: str) -> float | None:
    """Read the value of axis 0 that the stand-in reports of its engine."""
    if shown.startswith("engine 0 "):
        return None
    found = re.search(r"^axis 0 .*position (\S+)", shown, re.MULTILINE)
    assert found, shown
    return float(found.group(1))
