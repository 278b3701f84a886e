"""``python -m tools.bench.fleet``: robots of one ROS domain on one computer, started at once."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click
import numpy as np
from tools.bench.machine import machine
from tools.bench.process import MIB, Program, fresh_environment
from tools.bench.results import into_page, keep, out_option, table, told

from robotd_testing.domain import own_domain

SIZES = (1, 2, 4, 8, 16, 32)
RATE_HZ = 50
START_TIMEOUT_S = 60.0
SETTLE_S = 5.0  # discovery goes on for a while after the last robot is ready
LIST_TIMEOUT_S = 60.0
COLUMNS = {
    "robots": ("robots", "{:d}"),
    "all ready s": ("ready_s", "{:.1f}"),
    "`robotd list` s": ("listed_s", "{:.1f}"),
    "listed": ("listed", "{:d}"),
    "`robotd stop --all` s": ("stopped_s", "{:.1f}"),
    "first to last stop s": ("spread_s", "{:.2f}"),
    "traffic of the start MiB": ("start_mib", "{:.1f}"),
    "at rest kB/s": ("rest_kb_s", "{:.1f}"),
    "CPU of a robot %": ("cpu_percent", "{:.1f}"),
    "PSS of a robot MiB": ("pss_mib", "{:.0f}"),
}
STOP = re.compile(r"(\d+):(\d+):(\d+\.\d+) \[warning +\] motion stopped")  # in the log
Figures = dict[str, Any]


@click.command()
@click.option("--seconds", default=10.0, show_default=True, help="Length of each measurement.")
@click.option("--size", "sizes", type=int, multiple=True, help="Only so many robots; repeatable.")
@out_option
def main(seconds: float, sizes: tuple[int, ...], out: Path) -> None:
    """Measure cr3a on the simulation, 50 Hz, all its nodes, each robot in a namespace.

    Writes fleet.json, and the table into fleet.md where that is there. Traffic is that of the
    loopback interface: discovery, as nobody subscribes.
    """
    results: dict[str, Any] = {"machine": machine(), "seconds": seconds, "runs": [], "notes": []}
    for size in sizes or SIZES:
        click.echo(f"{size} robots", err=True)
        try:
            results["runs"].append(measure(size, seconds))
        except RuntimeError:
            results["notes"].append(f"{size}: not all are ready within {START_TIMEOUT_S:g} s")
            break
    report = "\n".join(_report(results))
    click.echo(report)
    keep(out, "fleet", results)
    into_page(out / "fleet.md", report)


def measure(size: int, seconds: float) -> Figures:
    """Start ``size`` robots at once; return what their start and their rest cost."""
    with ExitStack() as stack:
        environment = fresh_environment(stack.enter_context(own_domain()))
        environment["HOME"] = stack.enter_context(tempfile.TemporaryDirectory())
        sent, began_s = loopback_bytes(), time.monotonic()
        robots = [
            stack.enter_context(Program(command(number), environment)) for number in range(size)
        ]
        for robot in robots:
            robot.wait_output("ready after", START_TIMEOUT_S)
        ready_s, start_bytes = time.monotonic() - began_s, loopback_bytes() - sent
        time.sleep(SETTLE_S)
        sent, used_s = loopback_bytes(), -np.array([robot.cpu_s() for robot in robots])
        time.sleep(seconds)
        used_s += [robot.cpu_s() for robot in robots]
        rest_bytes = loopback_bytes() - sent
        timeout = f"--timeout={LIST_TIMEOUT_S:g}"
        listing, listed_s = timed(environment, "list", "--json", timeout)
        _, stopped_s = timed(environment, "stop", "--all", timeout)
        return {
            "robots": size,
            "ready_s": ready_s,
            "listed_s": listed_s,
            "listed": len(json.loads(listing)),
            "stopped_s": stopped_s,
            "spread_s": float(np.ptp([stop_s(robot) for robot in robots])),
            "start_mib": start_bytes / MIB / 1024,
            "rest_kb_s": rest_bytes / 1e3 / seconds,
            "cpu_percent": 100.0 * float(used_s.mean()) / seconds,
            "pss_mib": float(np.mean([robot.memory_mib()["pss_mib"] for robot in robots])),
        }


def timed(environment: dict[str, str], *arguments: str) -> tuple[str, float]:
    """Run a command of robotd; return its output and how long it took, s."""
    began_s = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "robotd", *arguments],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout, time.monotonic() - began_s


def stop_s(robot: Program) -> float:
    """Return when a robot was stopped, seconds of the day, as its log says."""
    [(hours, minutes, seconds)] = STOP.findall(robot.errors)
    return 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)


def command(number: int) -> list[str]:
    """Return the command that starts a robot."""
    options = ("--robot", "cr3a", "--backend", "sim", "--set", f"cycle.rate_hz={RATE_HZ}")
    ros = ("--ros-args", "-r", f"__ns:=/robot{number}")
    return [sys.executable, "-m", "robotd", *options, "--log-level", "warning", *ros]


def loopback_bytes() -> int:
    """Return how many bytes the loopback interface has sent."""
    return int(Path("/sys/class/net/lo/statistics/tx_bytes").read_text(encoding="ascii"))


def _report(results: dict[str, Any]) -> Iterator[str]:
    """Lines of Markdown."""
    yield f"{told(results['machine'])}; {results['seconds']:g} s each."
    yield ""
    yield table(COLUMNS, results["runs"])
    for note in results["notes"]:
        yield ""
        yield f"{note}."


if __name__ == "__main__":
    main()
