"""``robotd canopen``: scan a bus, access objects, simulate the nodes of a robot."""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robotd.api import IntegerRange, NumberRange
from robotd_cia402.object_commands import Objects, object_commands

if TYPE_CHECKING:
    from robotd_canopen.options import BusOptions

MULTICAST = "udp_multicast"

# Only click is imported at module level: other commands must not load python-can.


def _bus_options(command: Callable[..., Any]) -> Callable[..., Any]:
    for option in (
        click.option(
            "--bitrate",
            type=IntegerRange(),
            default=1_000_000,
            show_default=True,
            help="Bits per second.",
        ),
        click.option("--channel", metavar="NAME", required=True, help="Channel, such as can0."),
        click.option(
            "--interface", default="socketcan", show_default=True, help="python-can interface."
        ),
    ):
        command = option(command)
    return command


def _node_options(command: Callable[..., Any]) -> Callable[..., Any]:
    timeout = click.option(
        "--timeout",
        "timeout_s",
        type=NumberRange(0.001, 60),
        default=0.3,
        show_default=True,
        help="Seconds to wait for an answer; a store takes seconds.",
    )
    return _bus_options(timeout(command))


def _open_node(**options: Any) -> AbstractContextManager[Objects]:
    from robotd_canopen.bus_scan import sdo_of

    return sdo_of(**options)


@click.group()
def canopen() -> None:
    """CANopen networks: scan, objects, simulated drives."""


@canopen.command()
@_bus_options
@click.option(
    "--timeout",
    "timeout_s",
    type=NumberRange(),
    default=0.5,
    show_default=True,
    help="Seconds to wait.",
)
@click.option("--json", "as_json", is_flag=True, help="JSON, which 'new-robot --bus' reads.")
def scan(interface: str, channel: str, bitrate: int, timeout_s: float, *, as_json: bool) -> None:
    """List the nodes of a bus with identity, supported modes and NMT state."""
    from robotd_canopen.bus_scan import scan_bus, scan_sections

    found = scan_bus(interface, channel, bitrate, timeout_s)
    if as_json:
        click.echo(json.dumps(scan_sections(found, interface, channel, bitrate), indent=2))
        return
    for node in found:
        click.echo(str(node))
    click.echo(f"{len(found)} node{'' if len(found) == 1 else 's'} on {interface}:{channel}")


@canopen.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--node", type=IntegerRange(1, 127), default=1, show_default=True, help="Node id.")
@click.option(
    "--stream-mode",
    type=click.Choice(["csp", "ip"]),
    default="csp",
    show_default=True,
    help="As key.",
)
@click.option(
    "--velocity-mode",
    type=click.Choice(["pv", "csv"]),
    default="pv",
    show_default=True,
    help="As key.",
)
def eds(file: Path, node: int, stream_mode: str, velocity_mode: str) -> None:
    """Show what robotd does with an EDS or DCF: identity, PDOs, objects, values.

    It fails where the start refuses a drive that is as the file says. Nothing is sent. Without
    'rpdos' and 'tpdos' in the descriptor the PDOs are those shown.
    """
    from robotd_canopen.eds_report import eds_report
    from robotd_cia402.options import SetpointMode, VelocityMode

    modes = SetpointMode(stream_mode), VelocityMode(velocity_mode)
    for line in eds_report(file, node, *modes):
        click.echo(line)


canopen.add_command(object_commands("node", IntegerRange(1, 127), _node_options, _open_node))


def _simulated_bus(
    own: BusOptions, interface: str | None, channel: str | None, multicast: Mapping[str, int | None]
) -> BusOptions:
    """Return the bus of simulated nodes; the robot's ``own`` is one only where it is multicast."""
    from robotd_canopen.options import BusOptions

    if own.interface != MULTICAST or interface not in (None, MULTICAST):
        own = BusOptions(interface=interface or MULTICAST, channel="239.74.163.2")
    options = own.options
    if own.interface == MULTICAST:
        given = {key: value for key, value in multicast.items() if value is not None}
        options = {"port": 43113, "hop_limit": 0} | options | given
    return own.model_copy(update={"channel": channel or own.channel, "options": options})


@canopen.command()
@click.option("--robot", required=True, metavar="NAME|FILE", help="The robot.")
@click.option("--variant", metavar="NAME", help="Variant of the robot.")
@click.option("--interface", help="Interface of python-can; by default udp_multicast.")
@click.option("--channel", help="Channel; without one in the file 239.74.163.2.")
@click.option("--port", type=IntegerRange(), help="Port of udp_multicast; without one 43113.")
@click.option(
    "--hops",
    "hop_limit",
    type=IntegerRange(0, 255),
    help="Reach of udp_multicast: 0 is this computer, the default, 1 its networks.",
)
def simulate(
    robot: str, variant: str | None, interface: str | None, channel: str | None, **multicast: int
) -> None:
    """Simulate the robot's nodes in this process until Ctrl-C.

    On the bus of the robot's file where that is udp_multicast: no other one is sent to unless an
    option names it.

    Reads faults from the standard input, one per line: "help" lists them.
    """
    from robotd.api import load_robot_descriptor, validate_section
    from robotd_canopen.options import CanopenOptions
    from robotd_canopen.simulated_robot import HELP, inject, simulated_network

    descriptor = load_robot_descriptor(robot, variant)
    options = validate_section(descriptor, "backends.canopen", CanopenOptions)
    bus = _simulated_bus(options.bus, interface, channel, multicast)
    where = f"{bus.interface}:{bus.channel}"
    where += "".join(f", {key} {value}" for key, value in bus.options.items())
    with simulated_network(descriptor, options.model_copy(update={"bus": bus})) as network:
        ids = ", ".join(str(node) for node in network.members)
        click.echo(f"{descriptor.name}: nodes {ids} on {where}; 'help' lists faults")
        for line in sys.stdin:
            if line.strip():
                click.echo(HELP if line.strip() == "help" else inject(network, line))
        threading.Event().wait()
