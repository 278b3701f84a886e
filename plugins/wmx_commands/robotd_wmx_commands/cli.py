"""``robotd wmx``: scan the EtherCAT network through the engine, check a machine."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from robotd.api import MachineContext, diagnose, load_robot_descriptor, scan_network
from robotd_wmx_commands import INSTALL


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
    found = scan_network("wmx", _options(sdk), INSTALL)
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
    descriptors = tuple(load_robot_descriptor(robot) for robot in robots or ("cr3a",))
    context = MachineContext(descriptors, asks_devices=engine, options=_options(sdk))
    failed = False
    for finding in diagnose("wmx", context):
        failed |= finding.verdict == "failed"
        click.echo(finding.text)
    if not engine:
        click.echo("\nThe engine was not asked: --engine starts it and reads licence and network.")
    ctx.exit(1 if failed else 0)


def _options(sdk: Path | None) -> dict[str, str]:
    return {} if sdk is None else {"sdk": str(sdk)}


def slave_lines(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield one line for each slave, and their number."""
    for slave in found["slaves"]:
        modes = " ".join(slave["modes"])
        yield (
            f"master {slave['master']} slave {slave['slave']:3}: {slave['axes']} axes,"
            f" vendor 0x{slave['vendor_id']:08X}, product 0x{slave['product_code']:08X},"
            f" revision 0x{slave['revision']:08X}, serial {slave['serial']},"
            f" {slave['state']}{f'; {modes}' if modes else ''}"
        )
    count = len(found["slaves"])
    yield f"{count} slave{'' if count == 1 else 's'}"
