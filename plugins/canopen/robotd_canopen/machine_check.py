"""Readiness of a computer for CANopen: its CAN interfaces, and the adapters of the robots."""

from __future__ import annotations

import importlib.util
import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robotd.api import Finding, MachineContext, RobotdError, validate_section

NETWORK = Path("/sys/class/net")
ARPHRD_CAN = "280"  # linux/if_arp.h
TOOL_S = 5.0
BITRATE = 1_000_000
MIN_QUEUE = 100  # frames; the default of 10 is less than one period of an arm


def checks(context: MachineContext) -> Iterator[Finding]:
    """Yield the findings; nothing is sent."""
    library = importlib.util.find_spec("can")
    yield (
        Finding("ok", "python-can is installed")
        if library
        else Finding("failed", "python-can is not installed", "pip install python-can")
    )
    names = sorted(path.name for path in NETWORK.glob("*") if _read(path / "type") == ARPHRD_CAN)
    if not names:
        advice = f"connect the adapter; sudo ip link set can0 up type can bitrate {BITRATE}"
        yield Finding("warning", "no CAN interface", advice)
    for name in names:
        yield from _interface(name)
    for robot in context.robots:
        yield from _robot(robot, names)


def _interface(name: str) -> Iterator[Finding]:
    details = _details(name)
    information = details.get("linkinfo", {})
    if "UP" not in details.get("flags", ()):
        advice = f"sudo ip link set {name} up type can bitrate {BITRATE} restart-ms 100"
        yield Finding("failed", f"{name} is down", advice)
        return
    values = information.get("info_data", {})
    state = values.get("state", "up")
    bitrate = values.get("bittiming", {}).get("bitrate", 0)
    text = f"{name} is up{f', {bitrate} bit/s' if bitrate else ''}, {state}"
    if state in ("BUS-OFF", "ERROR-PASSIVE"):
        advice = f"check cable, termination and bit rate; sudo ip link set {name} down, then up"
        yield Finding("failed", text, advice)
    else:
        yield Finding("ok", text)
    queue = details.get("txqlen", MIN_QUEUE)
    if queue < MIN_QUEUE:
        advice = f"sudo ip link set {name} txqueuelen 1000"
        yield Finding("warning", f"{name} queues {queue} frames only", advice)


def _robot(robot: Any, names: list[str]) -> Iterator[Finding]:
    """Yield whether the channel that a robot names is there."""
    from robotd_canopen.options import CanopenOptions

    try:
        bus = validate_section(robot, "backends.canopen", CanopenOptions).bus
    except RobotdError as error:
        yield Finding("warning", f"{robot.name}: {error}")
        return
    if bus.interface == "socketcan" and bus.channel not in names:
        advice = f"available: {', '.join(names) or 'none'}; --set backends.canopen.bus.channel=NAME"
        yield Finding("failed", f"{robot.name}: no CAN interface {bus.channel!r}", advice)
    else:
        yield Finding("ok", f"{robot.name}: {bus.interface}:{bus.channel}")


def _details(name: str) -> dict[str, Any]:
    """Return what ``ip`` tells about an interface; empty where it fails."""
    command = ["ip", "-details", "-json", "link", "show", "dev", name]
    try:
        done = subprocess.run(  # noqa: S603 - an interface that exists
            command, capture_output=True, text=True, timeout=TOOL_S, check=True
        )
        [found] = json.loads(done.stdout)
    except (OSError, subprocess.SubprocessError, ValueError):
        return {}
    return dict(found)


def _read(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""
