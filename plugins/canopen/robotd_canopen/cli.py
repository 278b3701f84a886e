"""``robotd canopen``: scan a bus, access objects, simulate the nodes of a robot."""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import click

from robotd.api import IntegerRange, NumberRange
from robotd_cia402.object_commands import Objects, object_commands

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
def eds(file: Path, node: int, stream_mode: str) -> None:
    """Show what robotd does with an EDS or DCF: identity, PDOs, objects, values.

    Nothing is sent. Without 'rpdos' and 'tpdos' in the descriptor the PDOs are those shown.
    """
    from robotd_canopen.eds_report import eds_report
    from robotd_cia402.options import StreamMode

    for line in eds_report(file, node, StreamMode(stream_mode)):
        click.echo(line)


canopen.add_command(object_commands("node", IntegerRange(1, 127), _node_options, _open_node))


@canopen.command()
@click.option("--robot", required=True, metavar="NAME|FILE", help="The robot.")
@click.option("--variant", metavar="NAME", help="Variant of the robot.")
@click.option("--interface", default="udp_multicast", show_default=True, help="Interface.")
@click.option("--channel", default="239.74.163.2", show_default=True, help="Channel.")
@click.option(
    "--port", type=IntegerRange(), default=43113, show_default=True, help="Port of udp_multicast."
)
@click.option(
    "--hops",
    type=IntegerRange(0, 255),
    default=0,
    show_default=True,
    help="Reach of udp_multicast: 0 is this computer, 1 its networks.",
)
def simulate(
    robot: str, variant: str | None, interface: str, channel: str, port: int, hops: int
) -> None:
    """Simulate the robot's nodes in this process until Ctrl-C.

    Reads faults from the standard input, one per line: "help" lists them.
    """
    from robotd.api import load_robot_descriptor, validate_section
    from robotd_canopen.options import BusOptions, CanopenOptions
    from robotd_canopen.simulated_robot import HELP, inject, simulated_network

    descriptor = load_robot_descriptor(robot, variant)
    options = validate_section(descriptor, "backends.canopen", CanopenOptions)
    extra = {"port": port, "hop_limit": hops} if interface == "udp_multicast" else {}
    bus = BusOptions(interface=interface, channel=channel, options=extra)
    with simulated_network(descriptor, options.model_copy(update={"bus": bus})) as network:
        ids = ", ".join(str(node) for node in network.members)
        click.echo(f"{descriptor.name}: nodes {ids} on {interface}:{channel}; 'help' lists faults")
        for line in sys.stdin:
            if line.strip():
                click.echo(HELP if line.strip() == "help" else inject(network, line))
        threading.Event().wait()
