"""``robotd explain``: what happened in a recording, or the meaning of a code."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robotd.api import CodeTable, OperationError
from robotd.api.commands import (
    FILE,
    ExitCode,
    escaped,
    load_code_tables,
    log_options,
    parse_integer,
)
from robotd_messages.goal_result_codes import GOAL_RESULTS

if TYPE_CHECKING:  # it needs NumPy
    from robotd_recording.recording_reader import Recording

SUFFIX = ".mcap"


@click.command("explain")
@click.argument("target", metavar="FILE|CODE")
@click.option(
    "--plot",
    metavar="PNG",
    type=FILE,
    help="Write a picture of the ten seconds around the root cause.",
)
@log_options
def explain(*, target: str, plot: Path | None) -> ExitCode:
    """Explain a recording, or an alarm, error or abort code.

    For example: robotd explain cr3a-20261122-074057-fault.mcap, or robotd explain 0x8611. A
    negative code follows two dashes: robotd explain -- -4.
    """
    path = Path(target)
    if target and (path.suffix == SUFFIX or path.exists()):
        return _explain_file(path, plot)
    if plot is not None:
        raise click.BadParameter("belongs to a recording, not to a code", param_hint="'--plot'")
    return _explain_code(target)


def _explain_file(path: Path, plot: Path | None) -> ExitCode:
    from robotd_recorder.explanation import explain as lines_of
    from robotd_recorder.explanation import find_incident
    from robotd_recording.recording_reader import read_recording

    recording = read_recording(path)
    if plot is not None:
        _plot(recording, plot)  # first: its error stands alone
    cause = find_incident(recording).cause
    code = cause.data.get("code") if cause else None
    meanings = _meanings(int(code), _tables()) if isinstance(code, int) else []
    for line in lines_of(recording, meanings):
        click.echo(escaped(line))
    if plot is not None:
        click.echo(f"\npicture: {plot}")
    return ExitCode.OK


def _plot(recording: Recording, path: Path) -> None:
    """Write the picture. Raises BadParameter when that is not possible."""
    from robotd_recorder.incident_plot import plot_incident

    try:
        plot_incident(recording, path)
    except OperationError as error:
        raise click.BadParameter(str(error), param_hint="'--plot'") from error


def _explain_code(word: str) -> ExitCode:
    """Print every meaning of a number; FAILED when there is none."""
    tables = [GOAL_RESULTS, *_tables()]
    numbers = _numbers(word)
    lines = [*dict.fromkeys(line for code in numbers for line in _meanings(code, tables))]
    for line in lines:
        click.echo(line)
    if lines:
        return ExitCode.OK
    known = "; ".join(table.title for table in tables)
    click.echo(f"{word}: in no table (searched: {known})", err=True)
    return ExitCode.FAILED


def _numbers(word: str) -> list[int]:
    """Parse a code; one without 0x may be meant in hexadecimal too."""
    numbers = []
    for base in (0, 16):
        try:
            numbers.append(parse_integer(word, base))
        except ValueError:
            continue
    if not numbers:
        raise click.BadParameter(f"{word!r} is neither a file nor a number like 0x8611 or 1554")
    return numbers


def _meanings(code: int, tables: Sequence[CodeTable]) -> list[str]:
    """Return each meaning of a code, and below it what to do."""
    found = [(table.line(code), table.advice(code)) for table in tables if table.line(code)]
    texts = [text for line, advice in found for text in (line, f"  {advice}") if text.strip()]
    return [*dict.fromkeys(texts)]  # tables of several backends give the same advice


def _tables() -> list[CodeTable]:
    tables, failures = load_code_tables()
    for reason in failures.values():
        click.echo(reason, err=True)
    return tables
