"""``robotd wmx``: commands for machines with the SDK."""

from __future__ import annotations

import sys
from pathlib import Path

import click

# Nothing but click is imported up here: other commands must not wait for the SDK's libraries.


@click.group()
def wmx() -> None:
    """WMX machines: is this one ready?"""


@wmx.command()
@click.option(
    "--sdk",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Root of the SDK to look at.  [default: the one that the binding was built against]",
)
@click.option(
    "--engine",
    is_flag=True,
    help="Also ask the engine for licence, devices and network; start it unless it runs.",
)
def doctor(sdk: Path | None, *, engine: bool) -> None:
    """Look at this machine before a robot is started on it.

    Looks at the SDK's files, the binding, permissions and the kernel and, with --engine, at the
    engine. Nothing moves, no servo is switched, no communication is started. Ends with 1 when
    something is missing. When you ask for help, send all that it prints.
    """
    from robotd_wmx.doctor import report

    findings, passed = report(sdk, engine=engine)
    for finding in findings:
        advice = f"\n           {finding.advice}" if finding.advice else ""
        click.echo(f"{finding.verdict:>8}   {finding.what}{advice}")
    if not engine:
        click.echo("\nThe engine was not asked: --engine starts it and reads licence and network.")
    sys.exit(0 if passed else 1)
