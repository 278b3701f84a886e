"""``robotd wmx``: commands for machines with the WMX3 SDK."""

from __future__ import annotations

import json
from pathlib import Path

import click

from robotd.cli.wmx_doctor import diagnose
from robotd.cli.wmx_scan import scan_network, slave_lines


@click.group()
def wmx() -> None:
    """Readiness of a machine for the WMX backend."""


@wmx.command()
@click.option(
    "--sdk",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Root of the SDK.  [default: the one that the backend was built against]",
)
@click.option("--json", "as_json", is_flag=True, help="JSON, which 'new-robot --bus' reads.")
def scan(sdk: Path | None, *, as_json: bool) -> None:
    """List the slaves of the EtherCAT network with identity, state and supported modes.

    Starts the engine unless it runs. Nothing moves and no communication is started.
    """
    found = scan_network(sdk)
    if as_json:
        click.echo(json.dumps(found, indent=2))
        return
    for line in slave_lines(found):
        click.echo(line)


@wmx.command()
@click.option(
    "--sdk",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Root of the SDK to look at.  [default: WMX3_SDK_PATH, /opt/wmx3 or /opt/lmx]",
)
@click.option(
    "--robot",
    "robots",
    multiple=True,
    metavar="NAME|FILE",
    help="Also check the robot's parameter file; may be repeated.  [default: cr3a]",
)
@click.option(
    "--engine",
    is_flag=True,
    help="Also ask the engine for licence, devices and network; start it unless it runs.",
)
@click.pass_context
def doctor(ctx: click.Context, sdk: Path | None, robots: tuple[str, ...], *, engine: bool) -> None:
    """Check this machine before a robot is started on it.

    Looks at the SDK's files, network cards, ENI file, cores, permissions, a robot's parameter file,
    the backend and, with --engine, the engine. Works without SDK and backend. Nothing moves, no
    servo is switched, no communication is started. Ends with 1 when something is missing. When
    you ask for help, send all that it prints.
    """
    failed = 0
    for finding in diagnose(sdk, robots or ("cr3a",), engine=engine):
        failed += finding.verdict == "failed"
        advice = f"\n           {finding.advice}" if finding.advice else ""
        click.echo(f"{finding.verdict:>8}   {finding.what}{advice}")
    if not engine:
        click.echo("\nThe engine was not asked: --engine starts it and reads licence and network.")
    ctx.exit(1 if failed else 0)
