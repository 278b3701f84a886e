"""Drives that outlive robotd: in a process of their own, looked at without robotd."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import yaml

from robotd_canopen.scan import sdo_of

ROOT = Path(__file__).parents[2]
WMX_TESTS = ROOT / "plugins" / "wmx" / "tests"
GROUP = "239.74.163.32"
PORT = 20000 + os.getpid() % 20000
POSITION_ACTUAL = 0x6064  # in counts; CiA 402
STILL_S = 0.3  # without a change of position is standstill
POLL_S = 0.01
LONGEST_S = 10.0


Position = Callable[[], float | None]


@dataclass(frozen=True)
class World:
    """Drives and what to give to ``robotd run`` for them.

    Attributes:
        robot, backend: of ``robotd run``.
        watchdog_s: after which the drives know by themselves that nobody leads them.
        braking_s: the most that they need from then to standstill.
        look: called with the process id of robotd, before it is killed; what it returns tells the
            position of the first axis in the drive's units, or None when the engine is gone, and
            every axis with it.
    """

    robot: str
    backend: str
    watchdog_s: float
    braking_s: float
    look: Callable[[int], Position]


def seconds_to_rest(position: Position) -> float:
    """How long the first axis still moves from now on. Raises AssertionError when it goes on."""
    began_s = changed_s = time.monotonic()
    before = position()
    while (now_s := time.monotonic()) - changed_s < STILL_S:
        seen = position()
        if seen is None:
            return now_s - began_s
        if seen != before:
            before, changed_s = seen, now_s
        assert now_s - began_s < LONGEST_S, f"still moves after {LONGEST_S:g} s"
        time.sleep(POLL_S)
    return changed_s - began_s


@contextmanager
def canopen_world(folder: Path) -> Iterator[World]:
    """The simulated CiA 402 drives of the arm, over UDP multicast."""
    section = {
        "bus": {"interface": "udp_multicast", "channel": GROUP, "options": {"port": PORT}},
        "simulated": False,
    }
    robot = folder / "robot.yaml"
    content = {
        "extends": os.path.relpath(ROOT / "robots" / "cr3a" / "robot.yaml", folder),
        "cycle": {"rate_hz": 250},
        "engine": {"stale_after_s": 0.3},
        "ros_parameters": {"manipulator_state": {"joint_feedback_rate": 250}},
        "backends": {"canopen": section},
    }
    robot.write_text(yaml.safe_dump(content), encoding="utf-8")
    command = [sys.executable, "-m", "robotd", "canopen", "simulate", "--robot", "cr3a"]
    command += ["--channel", GROUP, "--port", str(PORT)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **pipes) as drives:  # type: ignore[call-overload]
        try:
            assert "nodes 1," in drives.stdout.readline()
            with sdo_of("udp_multicast", f"{GROUP}#{PORT}", 1_000_000, 1) as sdo:
                yield World(
                    str(robot),
                    "canopen",
                    watchdog_s=0.5,  # heartbeat_timeout_s
                    braking_s=1.0,
                    look=lambda _: (
                        lambda: int.from_bytes(
                            sdo.upload(POSITION_ACTUAL, 0), "little", signed=True
                        )
                    ),
                )
        finally:
            drives.kill()


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


def _position(shown: str) -> float | None:
    """Of axis 0, in what the stand-in tells of its engine."""
    if shown.startswith("engine 0 "):
        return None
    found = re.search(r"^axis 0 .*position (\S+)", shown, re.MULTILINE)
    assert found, shown
    return float(found.group(1))
