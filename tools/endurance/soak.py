"""``make soak``: a robot under traffic for as long as wanted, watched for growth and loss."""

from __future__ import annotations

import json
import re
import signal
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
from tests.ros.robot_process import Client, RobotProcess, wait_until
from tools.bench.machine import machine
from tools.bench.process import Program, fresh_environment
from tools.bench.results import out_option
from tools.bench.tables import aligned
from tools.endurance.figures import draw
from tools.endurance.judge import Bound, bounds
from tools.endurance.monitor import CycleLook, Monitor
from tools.endurance.traffic import kinds_for, newest
from tools.endurance.vitals import shm_total, vitals

from robotd.descriptor import RobotDescriptor, load_robot_descriptor

KEPT_SAMPLES = 720  # in the JSON: one in 5 s of an hour
TROUBLE = re.compile(r"\[(error|critical) *\]|Traceback", re.IGNORECASE)

Samples = dict[str, list[float]]


@dataclass(frozen=True)
class Run:
    """Result of a run: samples by name, counts, control loop at both ends."""

    samples: Samples
    counts: Counter[str]
    control_loop: tuple[CycleLook, CycleLook, float]
    ending: Counter[str]


@click.command()
@click.option("--minutes", default=60.0, show_default=True, help="Length of the run.")
@click.option("--robot", default="cr3a", show_default=True, help="Name or file.")
@click.option("--variant", help="Variant of the robot.")
@click.option("--backend", default="sim", show_default=True, help="What drives it.")
@click.option("--seed", default=1, show_default=True, help="Of the clients' random numbers.")
@out_option
def main(
    minutes: float, robot: str, variant: str | None, backend: str, seed: int, out: Path
) -> None:
    """Load a robot with traffic and see what grows. Exit status 1 when a bound is broken."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends the clients, too
    descriptor = load_robot_descriptor(robot, variant)
    facts = {"minutes": minutes, "robot": descriptor.name, "backend": backend, "seed": seed}
    facts |= {"variant": variant, "machine": machine()}
    run = _run(descriptor, robot, variant, backend, minutes, seed)
    judged = list(bounds(run.samples, run.counts, run.control_loop, run.ending))
    for line in _report(run, judged):
        click.echo(line)
    out.mkdir(parents=True, exist_ok=True)
    name = f"soak-{descriptor.name}-{backend}"
    title = f"{descriptor.name} on {backend}, {minutes:g} min"
    draw(run.samples, title, out / f"{name}.png")
    (out / f"{name}.json").write_text(_json(facts, run, judged), encoding="utf-8")
    click.echo(f"\nwritten to {out / name}.json and .png")
    sys.exit(not all(bound.kept for bound in judged))


def _run(
    descriptor: RobotDescriptor,
    robot: str,
    variant: str | None,
    backend: str,
    minutes: float,
    seed: int,
) -> Run:
    options = ["--variant", variant] if variant else []
    with ExitStack() as stack:
        daemon = stack.enter_context(
            RobotProcess(*options, robot=robot, backend=backend, patient=False)
        )
        daemon.wait_ready()
        client = Client(daemon.domain)
        stack.callback(client.close)
        monitor = Monitor(client)
        wait_until(lambda: monitor.first, "diagnostics")
        command = [sys.executable, "-m", "tools.endurance.traffic", "--robot", robot, *options]
        command += ["--domain", str(daemon.domain)]
        clients = [
            stack.enter_context(
                Program(
                    [*command, "--seed", str(seed * 100 + number), kind],
                    fresh_environment(daemon.domain),
                    started="{",
                )
            )
            for number, kind in enumerate(kinds_for(descriptor))
        ]
        samples = _watch(daemon, monitor, clients, minutes * 60.0)
        for program in clients:
            program.stop()
        counts = _added(clients)
        control_loop = _ends_of(monitor, descriptor)
        status = daemon.end(signal.SIGTERM)
        ending = Counter({"exit status after SIGTERM": abs(status)})
        ending["lines of errors in the log"] = len(TROUBLE.findall(daemon.output))
        return Run(samples, counts, control_loop, ending)


def _watch(
    daemon: RobotProcess, monitor: Monitor, clients: Sequence[Program], seconds: float
) -> Samples:
    """A sample a second until the time is over; raises RuntimeError when a process ends before."""
    samples: Samples = {}
    start_s = time.monotonic()
    for number in range(1, round(seconds) + 1):
        time.sleep(max(0.0, start_s + number - time.monotonic()))
        if (status := daemon.process.poll()) is not None:
            raise RuntimeError(f"robotd ended: status {status}: {daemon.output[-1000:]}")
        row = _row(daemon.process.pid, monitor, _added(clients)) | {
            "time_s": time.monotonic() - start_s
        }
        for name, value in row.items():
            samples.setdefault(name, []).append(value)
        if number % 60 == 0:
            click.echo(_progress(number // 60, row))
    return samples


def _row(pid: int, monitor: Monitor, counts: Counter[str]) -> dict[str, float]:
    control_loop = monitor.newest
    assert control_loop is not None
    return (
        asdict(vitals(pid))
        | {"shm_total": shm_total(), "joint_states": monitor.joint_states}
        | {
            key: value
            for key, value in asdict(control_loop).items()
            if key not in ("at_s", "level")
        }
        | {key: counts[key] for key in ("goals", "results", "calls", "answered", "rejected")}
    )


def _added(clients: Sequence[Program]) -> Counter[str]:
    return sum(map(newest, clients), Counter())


def _ends_of(monitor: Monitor, descriptor: RobotDescriptor) -> tuple[CycleLook, CycleLook, float]:
    assert monitor.first is not None
    assert monitor.newest is not None
    return monitor.first, monitor.newest, descriptor.cycle.rate_hz


def _progress(minute: int, row: Mapping[str, float]) -> str:
    return (
        f"{minute:4d} min: RSS {row['rss_mib']:.1f} MiB, {row['threads']:.0f} threads,"
        f" {row['fds']:.0f} fds, late p99 {row['lateness_p99_us']:.0f} µs,"
        f" missed {row['missed']:.0f}, goals {row['results']:.0f}/{row['goals']:.0f},"
        f" services {row['answered']:.0f}/{row['calls']:.0f}"
    )


def _report(run: Run, judged: Sequence[Bound]) -> list[str]:
    shown = [(what, number) for what, number in sorted(run.counts.items()) if number]
    rows = [["", "measured", "at most", "", ""]]
    for bound in judged:
        verdict = "kept" if bound.kept else "BROKEN"
        rows.append([bound.what, f"{bound.measured:.4g}", f"{bound.limit:g}", bound.unit, verdict])
    counts = aligned([["", "counted by the clients"], *([a, str(b)] for a, b in shown)])
    return ["", *counts, "", *aligned(rows)]


def _json(facts: dict[str, Any], run: Run, judged: Sequence[Bound]) -> str:
    step = max(1, len(run.samples["time_s"]) // KEPT_SAMPLES)
    content = facts | {
        "bounds": [asdict(bound) | {"kept": bound.kept} for bound in judged],
        "counts": dict(sorted(run.counts.items())),
        "samples": {
            name: json.dumps([round(value, 2) for value in values[::step]])
            for name, values in run.samples.items()
        },
    }
    text = json.dumps(content, indent=1)
    return re.sub(r'"(\[[^"]*\])"', r"\1", text) + "\n"  # a line for each row of samples


if __name__ == "__main__":
    main()
