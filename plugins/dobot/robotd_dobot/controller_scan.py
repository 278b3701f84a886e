"""Scan of a controller, and checks of the network to it."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from robotd.api import (
    Finding,
    InvalidArgument,
    MachineContext,
    MonotonicClock,
    RobotdError,
    RobotDescriptor,
    validate_section,
)
from robotd_dobot.device import DobotDevice
from robotd_dobot.options import SECTION, DobotOptions
from robotd_dobot.protocol import JOINTS

NAME = "dobot"
FEEDBACK_S = 1.0
NEAR_BITS = 24  # of the network that the maker configures


def scan(options: Mapping[str, str]) -> Mapping[str, Any]:
    """Return the arm at an ``address``, for ``robotd new-robot --bus``; nothing is changed.

    Raises InvalidArgument: no address. ConnectError: no controller.
    """
    address = options.get("address", "")
    if not address:
        raise InvalidArgument("name the controller, for example address=192.168.5.1")
    return {
        "backend": NAME,
        "options": {"address": address},
        "axes": [{} for _ in range(JOINTS)],
        "controller": ask(DobotOptions(address=address)),
    }


def ask(options: DobotOptions) -> str:
    """Return model, generation and mode of a controller. Raises ConnectError, NotReady."""
    clock = MonotonicClock()
    device = DobotDevice(options, clock)
    device.open()
    try:
        device.wait_for(lambda values: True, FEEDBACK_S, "feedback")
        return device.scan_network()
    finally:
        device.close()


def checks(context: MachineContext) -> Iterator[Finding]:
    """Yield findings about the route to the controllers that are named; only asked, it connects."""
    named = [found for robot in context.robots if (found := _options(robot))]
    if address := context.options.get("address"):
        named.append(DobotOptions(address=address))
    if not named:
        advice = f"name it: --set {SECTION}.address=192.168.5.1"
        yield Finding("warning", "no controller is named", advice)
    for options in named:
        yield _route(options.address)
        if context.asks_devices:
            yield _answer(options)


def _options(robot: RobotDescriptor) -> DobotOptions | None:
    with suppress(RobotdError):
        return validate_section(robot, SECTION, DobotOptions)
    return None


def _route(address: str) -> Finding:
    """Say from which address a controller is reached; nothing is sent for that."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.connect((address, 9))
            own, there = sock.getsockname()[0], sock.getpeername()[0]
    except OSError as error:
        advice = "connect the cable, and give its interface an address such as 192.168.5.100/24"
        return Finding("failed", f"no route to {address}: {error}", advice)
    near = ipaddress.ip_network(f"{there}/{NEAR_BITS}", strict=False)
    if ipaddress.ip_address(own) in near:
        return Finding("ok", f"{address} is reached from {own}")
    advice = f"give the interface of its cable an address in {near}"
    return Finding("warning", f"{address} is in another network than {own}", advice)


def _answer(options: DobotOptions) -> Finding:
    try:
        return Finding("ok", ask(options))
    except RobotdError as error:
        advice = "switch the cabinet on; try its other network socket"
        return Finding("failed", str(error), advice)
