"""``robotd ethercat``: scan a bus, access objects, show mappings, check a machine, simulate."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import click

from robotd.api import IntegerRange, MachineContext, ObjectNumber, diagnose
from robotd_cia402.object_commands import Objects, object_commands
from robotd_ethercat.simulate_command import simulate

# No more is imported at module level: other commands must not load pysoem.


def _bus_option(command: Callable[..., Any]) -> Callable[..., Any]:
    return click.option(
        "--interface", metavar="NAME", required=True, help="Network interface of the bus."
    )(command)


SLAVE = IntegerRange(0, 198)
_esi_option = click.option(
    "--esi",
    type=click.Path(exists=True, path_type=Path),
    metavar="DIR|FILE",
    help="ESI files (EtherCAT XML) of the slaves: names, PDOs, clocks. Not required.",
)


@click.group()
def ethercat() -> None:
    """EtherCAT networks: scan, objects, mappings, machine, simulated slaves.

    Not while a robot runs on the interface: two masters disturb each other.
    """


@ethercat.command()
@_bus_option
@_esi_option
@click.option("--json", "as_json", is_flag=True, help="JSON, which 'new-robot --bus' reads.")
def scan(interface: str, esi: Path | None, *, as_json: bool) -> None:
    """List the slaves in the order of the cable, with identity, state and supported modes.

    The slaves go to PreOp; nothing moves.
    """
    from robotd_ethercat.bus_scan import open_bus, read_library, scan_bus, scan_sections
    from robotd_ethercat.esi_report import scan_lines

    with open_bus(interface) as bus:
        found = scan_bus(bus)
    library = read_library(esi, found) if esi is not None else None
    for problem in library.problems if library is not None else ():
        click.echo(f"ESI left out: {problem}", err=True)
    if as_json:
        click.echo(json.dumps(scan_sections(found, interface, library), indent=2))
        return
    for slave in found:
        click.echo(str(slave))
        if library is not None:
            for line in scan_lines(slave.device(library)):
                click.echo(f"           {line}")
    advice = "" if found else ": check power and the cable to the IN port of the first one"
    click.echo(f"{len(found)} slave{'' if len(found) == 1 else 's'} on {interface}{advice}")


@ethercat.command()
@_bus_option
@_esi_option
@click.argument("slave", type=SLAVE)
def pdo(interface: str, esi: Path | None, slave: int) -> None:
    """Show the assigned PDOs of SLAVE and their objects, as rx_pdos and tx_pdos name them."""
    from robotd_ethercat.bus_scan import open_slave, pdos_of
    from robotd_ethercat.esi_reader import EsiLibrary
    from robotd_ethercat.mapping import Assignment, size_bytes

    device = None
    with open_slave(interface, slave) as opened:
        assignments = pdos_of(opened)
        identity = opened.identity()
    if esi is not None:
        device = EsiLibrary(esi, {identity[:2]}).find(*identity[:3])
    for assignment, pdos in assignments.items():
        outputs = assignment is Assignment.OUTPUTS
        key, way = ("rx_pdos", "to") if outputs else ("tx_pdos", "of")
        click.echo(f"{key}: 0x{assignment:04X}, {size_bytes(pdos)} bytes {way} the slave")
        for one in pdos:
            click.echo(f"  0x{one.index:04X}")
            for entry in one.entries:
                name = device.object_name(entry.index, entry.sub) if device is not None else ""
                click.echo(f"    {entry} {name}".rstrip())


@ethercat.command("esi")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--product",
    "products",
    type=ObjectNumber(),
    multiple=True,
    metavar="CODE",
    help="Product code; may be given several times, in the order of the cable.",
)
@click.option("--json", "as_json", is_flag=True, help="JSON, which 'new-robot --bus' reads.")
def show_esi(file: Path, products: tuple[int, ...], *, as_json: bool) -> None:
    """Show the devices of an ESI FILE (EtherCAT XML), and the PDOs that robotd chooses.

    With --product their PDOs, slots and clocks, too. No bus is needed.
    """
    from robotd_ethercat.esi_reader import of_products, read_esi
    from robotd_ethercat.esi_report import detail_lines, device_line, esi_sections

    found = read_esi(file)
    devices = of_products(found, products, file) if products else found
    if as_json:
        click.echo(json.dumps(esi_sections(devices), indent=2))
        return
    for device in devices:
        click.echo(device_line(device))
        for line in detail_lines(device) if products or len(devices) == 1 else ():
            click.echo(f"  {line}")


@ethercat.command()
@click.option("--interface", metavar="NAME", help="Network interface of the bus.")
@click.option("--slaves", is_flag=True, help="Also look for slaves; they go to PreOp.")
@click.pass_context
def doctor(ctx: click.Context, interface: str | None, *, slaves: bool) -> None:
    """Check permissions, kernel, cores and the settings of the interface; exit 1 on a failure.

    Without --interface it lists the interfaces of this computer. Nothing is sent without --slaves.
    """
    if slaves and interface is None:
        raise click.UsageError("--slaves needs --interface")
    options = {"interface": interface} if interface is not None else {}
    failed = False
    for finding in diagnose("ethercat", MachineContext(asks_devices=slaves, options=options)):
        failed |= finding.verdict == "failed"
        click.echo(finding.text)
    ctx.exit(1 if failed else 0)


def _open_slave(interface: str, slave: int) -> AbstractContextManager[Objects]:
    from robotd_ethercat.bus_scan import open_slave

    return open_slave(interface, slave)


ethercat.add_command(object_commands("slave", SLAVE, _bus_option, _open_slave))
ethercat.add_command(simulate)
