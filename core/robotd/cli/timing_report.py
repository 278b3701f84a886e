"""``robotd run --report FILE``: timing of the control loop as JSON."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path

import click

from robotd.control.loop.control_loop import ControlLoop


def reserve_report(path: Path) -> None:
    """Create the file, so that an unwritable path is reported before the robot runs."""
    try:
        path.touch()
    except OSError as error:
        raise click.BadParameter(f"{path}: {error.strerror}", param_hint="'--report'") from error


def write_report(path: Path, control_loop: ControlLoop) -> None:
    """Write figures and samples of a stopped control loop, by the names of the classes.

    ``LoopReport`` and ``PeriodSamples`` say what they mean.
    """
    figures = {
        key: None if math.isnan(value) else value
        for key, value in asdict(control_loop.stats.report()).items()
    }
    samples = control_loop.stats.samples()
    content = {
        "period_ns": control_loop.period_ns,
        "realtime": control_loop.realtime,
        "report": figures,
        "samples": {key: values.tolist() for key, values in vars(samples).items()},
    }
    path.write_text(json.dumps(content), encoding="utf-8")
