"""``robotd dynamixel``: which servos are on a port."""

from __future__ import annotations

import json

import click

from robotd.api import IntegerRange

# Only click is imported at module level: other commands must not load pyserial.


@click.group()
def dynamixel() -> None:
    """Dynamixel servos on a serial port."""


@dynamixel.command()
@click.option("--port", required=True, metavar="DEVICE", help="Port, such as /dev/ttyUSB0.")
@click.option(
    "--baudrate",
    type=IntegerRange(9600, 4_500_000),
    default=1_000_000,
    show_default=True,
    help="Bits per second.",
)
@click.option("--json", "as_json", is_flag=True, help="JSON, which 'new-robot --bus' reads.")
def scan(port: str, baudrate: int, *, as_json: bool) -> None:
    """List the servos of a port. Nothing is written and nothing moves; it takes 4 s."""
    from robotd_dynamixel.dynamixel_bus import DynamixelBus
    from robotd_serial_servo.bus_scan import opened, scan_sections, scan_servos

    with opened(DynamixelBus, port, baudrate) as bus:
        found = scan_servos(bus)
    if as_json:
        click.echo(json.dumps(scan_sections("dynamixel", found, port, baudrate), indent=2))
        return
    for servo in found:
        click.echo(str(servo))
    click.echo(f"{len(found)} servo{'' if len(found) == 1 else 's'} on {port}")
