"""``robotd conform``: run the conformance checks with pytest."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import click

from robotd.api import InvalidArgument, PluginError
from robotd.api.commands import FILE, ExitCode, load_robot, log_options
from robotd.api.features import why_unwritable
from robotd.api.models import parse_override
from robotd.api.robots import find_backend, load_backend
from robotd_conformance.watch import source_files, wait_for_change
from robotd_shared.foreign_process import death_of, is_foreign, probe_backend, run_noted

PACKAGE = "robotd_conformance.checks"
MISPLACED = 13  # exit status of pytest, see checks/conftest.py
GRACE_S = 30.0  # for axes to come to rest and the device to be closed, after Ctrl-C


@click.command("conform", epilog="What follows -- goes to pytest: robotd conform ... -- -x --pdb")
@click.option("--backend", metavar="NAME", required=True, help="The backend to check.")
@click.option("--robot", metavar="NAME|FILE", help="The robot that it drives; by default a bench.")
@click.option(
    "--junit",
    metavar="FILE",
    type=FILE,
    help="Write the results there too, as JUnit XML.",
)
@click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    multiple=True,
    help="Replace a value of the robot's file, e.g. backends.acme.port=502. May be repeated.",
)
@click.option(
    "--max-excursion",
    metavar="RAD",
    type=click.FloatRange(min=0.3, min_open=True),
    help="End a run on hardware when an axis is so far from its start pose; by default 0.45 rad.",
)
@click.option(
    "--range",
    "ranges",
    metavar="NAME=LOWER:UPPER",
    multiple=True,
    help="Positions that floor, table or cables leave an axis, rad or m. May be repeated.",
)
@click.option(
    "--quick",
    is_flag=True,
    help="Only the checks that find most faults: 20 s of processor time, minutes in real time.",
)
@click.option("--watch", is_flag=True, help="Run them again whenever the backend's code changes.")
@click.option("--thorough", is_flag=True, help="Also what only time reveals; minutes longer.")
@click.option(
    "--resume",
    metavar="FILE",
    type=FILE,
    help="Note the results in FILE; a run that was stopped goes on from there.",
)
@click.option("-k", "expression", metavar="EXPR", help="Only checks whose names match.")
@click.argument("pytest_arguments", metavar="[-- ARG...]", nargs=-1, type=click.UNPROCESSED)
@log_options
def conform(
    backend: str,
    robot: str | None,
    junit: Path | None,
    expression: str | None,
    overrides: Sequence[str],
    max_excursion: float | None,
    ranges: Sequence[str],
    quick: bool,
    watch: bool,
    thorough: bool,
    resume: Path | None,
    pytest_arguments: Sequence[str],
) -> ExitCode:
    """Run the conformance checks on a backend. Axes move.

    Ctrl-C, or the loss of the terminal, stops the axes and shuts down in order.
    """
    if find_spec("pytest") is None:
        raise PluginError("the checks need pytest: pip install 'robotd[testing]'")
    if junit is not None and (reason := why_unwritable(junit.absolute().parent)):
        raise InvalidArgument(f"--junit: nothing can be written to {reason}")
    foreign = is_foreign(find_backend(backend)[0])
    if foreign:
        probe_backend(backend)
    if robot is not None:
        descriptor = load_robot(
            robot, overrides=[parse_override(override) for override in overrides]
        )
        if not foreign:  # whose code runs in a process of its own only
            load_backend(backend).context(descriptor)
    arguments = [
        f"--robotd-backend={backend}",
        *([f"--robotd-robot={robot}"] if robot else []),
        *(f"--robotd-set={override}" for override in overrides),
        *([] if max_excursion is None else [f"--robotd-max-excursion={max_excursion}"]),
        *(f"--robotd-range={range_text}" for range_text in ranges),
        *(["--robotd-quick"] if quick else []),
        *(["--robotd-thorough"] if thorough else []),
        *([f"--robotd-resume={resume.absolute()}"] if resume else []),
        "--robotd-progress",
        *([f"--junitxml={junit}"] if junit else []),
        *(["-k", expression] if expression else []),
        *pytest_arguments,
    ]
    while True:
        files = source_files(backend)
        status, _, step = run_noted(
            [*pytest_command(), *arguments], _environment(), capture=False, grace_s=GRACE_S
        )
        if step != "done":
            error = death_of(backend, status, step)
            if not watch:
                raise error
            click.echo(str(error))
        elif not watch:
            return {0: ExitCode.OK, MISPLACED: ExitCode.CONFIGURATION}.get(status, ExitCode.PLUGIN)
        click.echo(f"waiting for a change of the code of {backend}; Ctrl-C ends")
        changed = wait_for_change(backend, files)
        click.echo(f"changed: {', '.join(path.name for path in changed)}")


def pytest_command() -> list[str]:
    """Return the pytest command line; settings of the current folder are ignored."""
    checks = Path(__file__).parent / "checks"
    return [
        sys.executable,
        "-m",
        "pytest",
        "--pyargs",
        PACKAGE,
        f"--rootdir={checks}",
        f"--config-file={os.devnull}",
        "--import-mode=importlib",
        "--quiet",
        "-rN",  # the report at the end names what failed
        "--tb=short",
        "-p",
        "no:cacheprovider",
    ]


def _environment() -> dict[str, str]:
    """Without what could keep pytest from finding robotd's options."""
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
