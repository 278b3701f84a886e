"""Readiness of a computer for FCI: library, real-time kernel and rights, the arm's port."""

from __future__ import annotations

import importlib.util
import os
import resource
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from robotd.api import Finding, MachineContext, RobotdError, RobotDescriptor, validate_section
from robotd_franka.options import FrankaOptions

REALTIME = Path("/sys/kernel/realtime")
GOVERNORS = Path("/sys/devices/system/cpu")
FCI_PORT = 1337
CONNECT_S = 2.0


def checks(context: MachineContext) -> Iterator[Finding]:
    """Yield the findings; a port is opened only where devices may be asked."""
    if importlib.util.find_spec("franky") is None:
        yield Finding("failed", "franky-control is not installed", "pip install 'robotd[franka]'")
    named = [options for robot in context.robots if (options := _options(robot)) is not None]
    if not named or any(options.needs_realtime for options in named):
        yield from _kernel()
    for options in named:
        if context.asks_devices and options.address:
            yield _port(options.address)


def _kernel() -> Iterator[Finding]:
    if REALTIME.exists() and REALTIME.read_text().strip() == "1":
        yield Finding("ok", "the kernel is PREEMPT_RT")
    else:
        text = "the kernel is not PREEMPT_RT: the arm drops late packets and stops by a reflex"
        yield Finding("failed", text, "install one, such as Ubuntu's linux-realtime")
    if resource.getrlimit(resource.RLIMIT_RTPRIO)[0] == 0 and os.geteuid():
        text = "no right to real-time priorities"
        yield Finding("failed", text, "add '@realtime - rtprio 99' to /etc/security/limits.conf")
    saving = [
        path.parts[-3]
        for path in GOVERNORS.glob("cpu[0-9]*/cpufreq/scaling_governor")
        if path.read_text().strip() == "powersave"
    ]
    if saving:
        text = f"power saving on {len(saving)} processors delays packets"
        yield Finding("warning", text, "sudo cpupower frequency-set -g performance")


def _port(address: str) -> Finding:
    """Connect to the port and disconnect, without a word of the protocol."""
    try:
        socket.create_connection((address, FCI_PORT), CONNECT_S).close()
    except OSError as error:
        text = f"FCI at {address}:{FCI_PORT} does not answer: {error}"
        return Finding("failed", text, "open the brakes and activate FCI in Desk; check the cable")
    return Finding("ok", f"FCI at {address}:{FCI_PORT} answers")


def _options(robot: RobotDescriptor) -> FrankaOptions | None:
    with suppress(RobotdError):
        return validate_section(robot, "backends.franka", FrankaOptions)
    return None
