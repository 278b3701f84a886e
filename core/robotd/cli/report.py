"""``robotd run --report FILE``: how well the cycle kept its time, for programs."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path

import click

from robotd.cycle.loop import Cycle


def reserve_report(path: Path) -> None:
    """Make the file now: what cannot be written is better known before the robot runs."""
    try:
        path.touch()
    except OSError as error:
        raise click.BadParameter(f"{path}: {error.strerror}", param_hint="'--report'") from error


def write_report(path: Path, cycle: Cycle) -> None:
    """Write figures and samples of a cycle that has ended; the keys are those of the classes.

    ``CycleReport`` and ``CycleSamples`` say what they mean.
    """
    figures = {
        key: None if math.isnan(value) else value
        for key, value in asdict(cycle.stats.report()).items()
    }
    samples = cycle.stats.samples()
    content = {
        "period_ns": cycle.period_ns,
        "realtime": cycle.realtime,
        "report": figures,
        "samples": {key: values.tolist() for key, values in vars(samples).items()},
    }
    path.write_text(json.dumps(content), encoding="utf-8")
