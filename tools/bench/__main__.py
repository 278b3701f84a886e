"""``make bench``: measure everything in one run, print it, keep it as JSON and pictures."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import click
from tools.bench.c_program import CannotBuildError, CProgram
from tools.bench.computer import computer
from tools.bench.figures import draw
from tools.bench.machine import machine
from tools.bench.planning import planning
from tools.bench.process import fresh_environment
from tools.bench.results import keep, out_option, told_costs
from tools.bench.scenario import Measured, measure, subscriber
from tools.bench.subjects import subjects
from tools.bench.tables import tables
from tools.bench.targets import targets

from robotd_testing.domain import own_domain


@click.command()
@click.option("--seconds", default=8.0, show_default=True, help="Length of each measurement.")
@out_option
@click.option("--only", multiple=True, metavar="NAME", help="Only these; * and ? as in a shell.")
def main(seconds: float, out: Path, only: Sequence[str]) -> None:
    """Measure robotd on the simulation, beside C and plain rclpy. Reports, never fails."""

    def wanted(name: str) -> bool:
        return not only or any(fnmatch(name, pattern) for pattern in only)

    results: dict[str, Any] = {"machine": machine() | computer(), "seconds": seconds, "notes": []}
    with tempfile.TemporaryDirectory(prefix="robotd-bench-") as folder:
        measured = _measure(Path(folder), seconds, wanted, results["notes"])
        results["subjects"] = {name: measurement.figures for name, measurement in measured.items()}
        results["costs"] = {}
        if wanted("costs"):
            with own_domain() as domain, subscriber(domain, Path(folder) / "costs.npz"):
                results["costs"] = _costs(seconds, domain, results["notes"])
        results["planning"] = planning(Path(folder)) if wanted("planning") else {}
    rows = targets(results["subjects"], results["costs"], results["planning"])
    results["targets"] = [asdict(row) for row in rows]
    results["load_after"] = os.getloadavg()[0]
    for line in (*_heading(results), *tables(results, rows)):
        print(line)
    keep(out, "latest", _rounded(results))
    if measured:
        draw(measured, out)
    print(f"\nwritten to {out}")


def _measure(folder: Path, seconds: float, wanted: Any, notes: list[str]) -> dict[str, Measured]:
    c_program = None
    try:
        c_program = CProgram(folder) if any(map(wanted, ("c-500", "c-1000"))) else None
    except CannotBuildError as error:
        notes.append(f"no C baseline: {error}")
    measured = {}
    for subject in subjects(c_program, folder):
        if not wanted(subject.name):
            continue
        print(f"{subject.name}: {subject.rate_hz} Hz, {subject.load.value}", file=sys.stderr)
        try:
            measured[subject.name] = measure(subject, seconds, folder)
        except (RuntimeError, AssertionError, OSError, LookupError) as error:
            notes.append(f"{subject.name} failed: {error}")
    return measured


def _costs(seconds: float, domain: int, notes: list[str]) -> dict[str, Any]:
    print("costs of the parts of a period", file=sys.stderr)
    result = subprocess.run(
        [sys.executable, "-m", "tools.bench.costs", str(seconds / 2)],
        env=fresh_environment(domain),
        capture_output=True,
        text=True,
        check=False,
    )
    if result.returncode:
        notes.append(f"costs failed: {result.stderr.strip().splitlines()[-1]}")
        return {}
    costs: dict[str, Any] = json.loads(result.stdout)
    return costs


def _heading(results: dict[str, Any]) -> list[str]:
    facts = results["machine"]
    lines = [
        f"{facts['cpu']}, {facts['cores']} cores, Linux {facts['kernel']}{told_costs(facts)}",
        f"Python {facts['python']}, commit {facts['commit']}"
        + (" with changes" if facts["uncommitted_changes"] else "")
        + f", load before {facts['load_before']:.2f}, after {results['load_after']:.2f}",
    ]
    return lines + [f"note: {note}" for note in results["notes"]]


def _rounded(value: Any) -> Any:
    """Four significant digits are more than a repetition agrees on; JSON knows no NaN."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.4g}") if math.isfinite(value) else None
    return value


if __name__ == "__main__":
    main()
