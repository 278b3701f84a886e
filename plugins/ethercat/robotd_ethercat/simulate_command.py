"""``robotd ethercat simulate``: slaves on a virtual cable, or on a network interface."""

from __future__ import annotations

import gc
import os
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robotd.api import IntegerRange

# Without root, a namespace can be made before modules with threads of their own are loaded only.

if TYPE_CHECKING:
    from robotd_ethercat.simulated import Bus, Line

MASTER, SLAVES = "ecat0", "slaves0"
SECOND_MASTER, SECOND_SLAVES = "ecat1", "slaves1"


@click.command()
@click.option("--robot", metavar="NAME|FILE", help="The robot.")
@click.option("--variant", metavar="NAME", help="Variant of the robot.")
@click.option(
    "--descriptor",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="The robot as JSON, written by the backend, in place of --robot.",
)
@click.option("--generic", type=IntegerRange(1, 199), metavar="N", help="N generic slaves.")
@click.option("--redundant", is_flag=True, help="Connect the other end of the line, too.")
@click.option("--interface", metavar="NAME", help="Serve a network interface of this computer.")
@click.option("--exit-on-eof", is_flag=True, help="End with the standard input.")
def simulate(
    robot: str | None,
    variant: str | None,
    descriptor: Path | None,
    generic: int | None,
    interface: str | None,
    *,
    redundant: bool,
    exit_on_eof: bool,
) -> None:
    """Simulate EtherCAT slaves in this process until Ctrl-C.

    By default on a virtual cable in a network namespace of its own; a master opens the interface
    "ecat0" there. Reads faults from the standard input, one per line: "help" lists them.
    """
    if [robot, descriptor, generic].count(None) != 2:
        raise click.UsageError("give one of --robot, --descriptor and --generic")
    if interface is not None and redundant:
        raise click.UsageError("--redundant is for virtual cables only")
    try:
        place, ends = _prepare(interface, redundant=redundant)
    except OSError as error:
        from robotd_ethercat.bus_namespace import missing_rights

        raise click.ClickException(missing_rights() or str(error)) from error
    if generic is not None:
        name, line, priority = _generic(generic, redundant=redundant)
    else:
        name, line, priority = _robot(robot, variant, descriptor, redundant=redundant)
    from robotd.api import request_realtime
    from robotd_ethercat.simulated import Bus

    bus = Bus(line, *ends)
    click.echo(f"{name}: {len(line.slaves)} slaves on {place}; 'help' lists faults")
    threading.Thread(target=_read_commands, args=(bus, exit_on_eof), daemon=True).start()
    request_realtime(priority)
    gc.freeze()
    try:
        bus.run()
    except KeyboardInterrupt:
        return
    finally:
        bus.close()


def _prepare(interface: str | None, *, redundant: bool) -> tuple[str, Sequence[str]]:
    """Make the cables; return the place of the master, and the interfaces of the slaves."""
    from robotd_ethercat.simulated.virtual_cable import make_cable, new_namespace

    if interface is not None:
        return interface, [interface]
    new_namespace()
    make_cable(MASTER, SLAVES)
    ends, place = [SLAVES], MASTER
    if redundant:
        make_cable(SECOND_MASTER, SECOND_SLAVES)
        ends, place = [SLAVES, SECOND_SLAVES], f"{MASTER} and {SECOND_MASTER}"
    return f"{place} of /proc/{os.getpid()}/ns/net", ends


def _generic(count: int, *, redundant: bool) -> tuple[str, Line, int]:
    """Return name, slaves and real-time priority."""
    import time

    from robotd_ethercat.simulated import GenericSlave, Line

    now_ns = time.monotonic_ns()
    return "generic", Line([GenericSlave(now_ns) for _ in range(count)], redundant=redundant), 1


def _robot(
    name: str | None, variant: str | None, path: Path | None, *, redundant: bool
) -> tuple[str, Line, int]:
    """Return name, slaves and real-time priority: slaves do not wait for the processor."""
    from robotd.api import RobotDescriptor, load_robot_descriptor
    from robotd_ethercat.simulated_robot import simulated_line

    if path is not None:
        robot = RobotDescriptor.model_validate_json(path.read_bytes())
    else:
        robot = load_robot_descriptor(name or "", variant)
    priority = max(1, robot.cycle.realtime_priority - 2)
    return robot.name, simulated_line(robot, redundant=redundant), priority


def _read_commands(bus: Bus, exit_on_eof: bool) -> None:
    from robotd_ethercat.simulated.fault_commands import HELP, inject

    for text in sys.stdin:
        if text.strip() == "help":
            click.echo(HELP)
        elif text.strip():
            bus.call(lambda text=text: click.echo(inject(bus.line, text)))  # type: ignore[misc]
    if exit_on_eof:
        bus.stop()


if __name__ == "__main__":
    simulate()
