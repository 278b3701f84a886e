"""Scan and checks of the backend ``feetech``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from robotd.api import Finding, MachineContext
from robotd_feetech.options import FeetechOptions
from robotd_feetech.sts_bus import StsBus
from robotd_serial_servo.bus_scan import opened, scan_options, scan_sections, scan_servos
from robotd_serial_servo.machine_check import port_checks

NAME = "feetech"


def scan(options: Mapping[str, str]) -> Mapping[str, Any]:
    """Return the servos of a port, for ``robotd new-robot --bus``.

    Args:
        options: ``port`` (or ``address``), and ``baudrate`` where it is not 1000000.

    Raises InvalidArgument: no port, or no number. ConnectError: the port does not open.
    """
    port, baudrate = scan_options(options)
    with opened(StsBus, port, baudrate) as bus:
        return scan_sections(NAME, scan_servos(bus), port, baudrate)


def checks(context: MachineContext) -> Iterator[Finding]:
    """Yield findings about serial ports; nothing is opened."""
    return port_checks(context, FeetechOptions, NAME)
