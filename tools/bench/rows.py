"""Rows of the comparison with ros2_control, each the median of some alternating rounds.

``python -m tools.bench.rows``: robotd and the C program one after the other, round by round, so
that other work on the computer meets both. ``--python`` measures robotd of another checkout, too.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from tests.ros.robot_process import ACTION
from tools.bench.c_program import CannotBuildError, CProgram
from tools.bench.computer import computer
from tools.bench.machine import machine
from tools.bench.process import fresh_environment
from tools.bench.results import into_page, keep, out_option, told
from tools.bench.scenario import measure, subscriber
from tools.bench.subjects import Load, Subject, c_subject, daemon
from tools.bench.tables import aligned

from robotd_testing.domain import own_domain

GOALS = 60  # two of three are executed, the third is cancelled
SERVICES = 60
RATE_HZ = 500

Figures = dict[str, float]

# Row → figure, goal of the row, factor to its unit. A row without a goal shows what the computer
# takes for the least: with two busy cores most of a call is waiting for a core.
ROWS = (
    ("service answered p50, ms", "rested_service_p50_us", None, 1e-3),
    ("service answered p50, two busy cores, ms", "busy_rested_service_p50_us", None, 1e-3),
    ("goal accepted p50, ms", "accepted_p50_us", 0.9, 1e-3),
    ("goal accepted p90, ms", "accepted_p90_us", 1.3, 1e-3),
    ("goal accepted p50, two busy cores, ms", "busy_accepted_p50_us", 1.2, 1e-3),
    ("end of a 0.3 s goal to result p50, ms", "result_p50_us", 6.0, 1e-3),
    ("end of a 0.3 s goal to result p50, two busy cores, ms", "busy_result_p50_us", 7.7, 1e-3),
    ("cancel answered p50, ms", "canceled_p50_us", 0.8, 1e-3),
    ("cancel to result p50, quiet, ms", "cancel_result_p50_us", 10.0, 1e-3),
    ("cancel to result p50, two busy cores, ms", "busy_cancel_result_p50_us", 30.0, 1e-3),
    ("CPU at rest, simulation not counted, %", "rest_cpu_percent", 5.5, 1.0),
    ("CPU moving, simulation not counted, %", "moving_cpu_percent", 7.0, 1.0),
    ("simulated drives, six axes, moving, %", "simulation_cpu_percent", 1.5, 1.0),
    ("stamp deviation p50, us", "period_error_p50_us", 12.0, 1.0),
    ("start to first joint state, s", "start_s", 0.45, 1.0),
    ("resident memory, MiB", "rss_mib", 90.0, 1.0),
    ("lateness p99, 500 Hz, ms", "lateness_p99_us", 0.5, 1e-3),
    ("lateness p99, services and motion, ms", "busy_lateness_p99_us", 0.5, 1e-3),
    ("deadlines missed at 1 kHz, %", "fast_missed_percent", 0.1, 1.0),
)


@click.command()
@click.option("--rounds", default=5, show_default=True, help="Alternating rounds.")
@click.option("--seconds", default=4.0, show_default=True, help="Length of each window.")
@click.option("--python", "pythons", multiple=True, help="Interpreter of another checkout.")
@out_option
def main(rounds: int, seconds: float, pythons: Sequence[str], out: Path) -> None:
    """Print every row with its goal, for robotd, other checkouts and the C program."""
    facts = machine() | computer()
    with tempfile.TemporaryDirectory(prefix="robotd-bench-") as folder:
        found = _rounds(rounds, seconds, [sys.executable, *pythons], Path(folder))
    medians = {name: _medians(figures) for name, figures in found.items()}
    for line in aligned(list(_table(medians))):
        print(line)
    keep(out, "rows", {"machine": facts, "rounds": rounds, "rows": medians})
    into_page(out / "README.md", "\n".join(_report(facts, rounds, medians)))


def _rounds(
    rounds: int, seconds: float, pythons: Sequence[str], folder: Path
) -> dict[str, list[Figures]]:
    found: dict[str, list[Figures]] = {}
    try:
        c_program = CProgram(folder)
    except CannotBuildError as error:
        c_program = None
        print(f"no C baseline: {error}", file=sys.stderr)
    subjects: dict[str, Callable[[], Figures]] = {
        "robotd" if python == sys.executable else python: partial(_robotd, python, seconds, folder)
        for python in pythons
    }
    if c_program is not None:
        subjects["C"] = partial(_c_program, c_program, seconds, folder)
    for index in range(rounds):
        for name, measured in subjects.items():
            print(f"round {index + 1} of {rounds}: {name}", file=sys.stderr)
            try:
                found.setdefault(name, []).append(measured())
            except (RuntimeError, AssertionError, OSError, LookupError) as error:
                print(f"failed, without this round: {error}", file=sys.stderr)
    return found


def _medians(figures: Sequence[Figures]) -> Figures:
    keys = dict.fromkeys(key for figure in figures for key in figure)
    return {
        key: float(np.median([figure[key] for figure in figures if key in figure])) for key in keys
    }


def _robotd(python: str, seconds: float, folder: Path) -> Figures:
    rest = daemon(RATE_HZ, Load.NONE, folder, python)
    figures = _of(rest, seconds, folder)
    moving = _of(daemon(RATE_HZ, Load.MOVING, folder, python), seconds, folder)
    busy = _of(daemon(RATE_HZ, Load.BUSY, folder, python), seconds, folder)
    figures["busy_lateness_p99_us"] = busy["lateness_p99_us"]
    fast = _of(daemon(2 * RATE_HZ, Load.NONE, folder, python), seconds, folder)
    figures["fast_missed_percent"] = 100.0 - fast["met_percent"]
    at_rest, in_motion = _simulation_percent(python, seconds, folder)
    figures["rest_cpu_percent"] = figures["cpu_percent"] - at_rest
    figures["moving_cpu_percent"] = moving["cpu_percent"] - in_motion
    figures["simulation_cpu_percent"] = in_motion
    return figures | _quiet_and_busy(lambda: _services(rest) | _goals(rest, folder))


def _c_program(program: CProgram, seconds: float, folder: Path) -> Figures:
    subject = c_subject(program, RATE_HZ)
    figures = _of(subject, seconds, folder) | _quiet_and_busy(lambda: _services(subject))
    fast = _of(c_subject(program, 2 * RATE_HZ), seconds, folder)
    return figures | {
        "rest_cpu_percent": figures["cpu_percent"],
        "fast_missed_percent": 100.0 - fast["met_percent"],
    }


def _of(subject: Subject, seconds: float, folder: Path) -> Figures:
    return measure(subject, seconds, folder).figures


def _quiet_and_busy(measured: Callable[[], Figures]) -> Figures:
    """Figures on a quiet computer, and with the prefix ``busy_`` those beside two busy cores."""
    figures = measured()
    with _busy_cores():
        return figures | {f"busy_{name}": value for name, value in measured().items()}


def _services(subject: Subject) -> Figures:
    """Times of a service that answers from memory, by a client in another process."""
    with own_domain() as domain, subject.program(domain):
        command = [sys.executable, "-m", "tools.bench.service_client"]
        figures: Figures = _json([*command, subject.service, str(SERVICES)], domain, Path())
        return figures


def _goals(subject: Subject, folder: Path) -> Figures:
    """Times of goals and cancels, by a client in another process."""
    with ExitStack() as stack:
        domain = stack.enter_context(own_domain())
        stack.enter_context(subscriber(domain, folder / "goals.npz"))
        stack.enter_context(subject.program(domain)).wait_output(subject.ready)
        command = [sys.executable, "-m", "tools.bench.goal_client", ACTION, str(GOALS)]
        figures: Figures = _json(command, domain, Path())
        return figures


@contextmanager
def _busy_cores() -> Iterator[None]:
    """Keep two cores busy with other work of normal priority."""
    hogs = [subprocess.Popen([sys.executable, "-S", "-c", "while True: pass"]) for _ in range(2)]
    try:
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


def _simulation_percent(python: str, seconds: float, folder: Path) -> tuple[float, float]:
    """CPU of the simulated drives at rest and moving, in percent of a core."""
    with own_domain() as domain, subscriber(domain, folder / "costs.npz"):
        checkout = Path(python).parents[2]
        costs = _json([python, "-m", "tools.bench.costs", str(seconds)], domain, checkout)

    def percent(phase: str) -> float:
        parts = (costs[phase].get(name) for name in ("read", "stream"))
        mean_us: float = sum(part["mean_us_per_period"] for part in parts if part)
        return mean_us * RATE_HZ / 1e4

    return percent("at rest"), percent("moving")


def _json(command: list[str], domain: int, folder: Path) -> Any:
    environment = fresh_environment(domain)
    result = subprocess.run(
        command, env=environment, cwd=folder, capture_output=True, text=True, check=False
    )
    if result.returncode:
        raise RuntimeError(f"{command}: {result.stderr.strip().splitlines()[-1]}")
    return json.loads(result.stdout)


def _report(facts: Mapping[str, Any], rounds: int, medians: dict[str, Figures]) -> Iterator[str]:
    """Lines of Markdown: of what, and the table."""
    yield f"{told(facts)}; medians of {rounds} rounds. ✓: the goal is met.\n"
    (_, *columns), *rows = _table(medians, mark=" ✓")
    yield f"| | {' | '.join(columns)} |"
    yield "|---|" + "---:|" * len(columns)
    yield from (f"| {' | '.join(row)} |" for row in rows)


def _table(medians: dict[str, Figures], mark: str = "") -> Iterator[Sequence[str]]:
    yield ("", "goal", *medians)
    for row, figure, goal, factor in ROWS:
        cells = (
            _cell(figures_of.get(figure), goal, factor, mark) for figures_of in medians.values()
        )
        yield (row, "–" if goal is None else f"{goal:g}", *cells)


def _cell(value: float | None, goal: float | None, factor: float, mark: str) -> str:
    if value is None:
        return "–"
    is_met = goal is not None and value * factor <= goal
    return f"{value * factor:.2f}{mark if is_met else ''}"


if __name__ == "__main__":
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    main()
