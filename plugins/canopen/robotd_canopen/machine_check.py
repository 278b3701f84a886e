"""Readiness of a computer for CANopen: its CAN interfaces, and the adapters of the robots."""

from __future__ import annotations

import importlib.util
import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robotd.api import Finding, MachineContext, RobotdError, validate_section
from robotd_canopen.options import DISCARDING, QUEUELESS

NETWORK = Path("/sys/class/net")
ARPHRD_CAN = "280"  # linux/if_arp.h
TOOL_S = 5.0
BITRATE = 1_000_000
QUEUE, QUEUE_PERIODS = "pfifo_head_drop", 2  # drops the oldest frame; a limit of so many periods


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


def _robot(robot: Any, names: list[str]) -> Iterator[Finding]:
    """Yield whether the channel that a robot names is there, and how its frames queue."""
    from robotd_canopen.layout import plan_network
    from robotd_canopen.options import CanopenOptions

    try:
        options = validate_section(robot, "backends.canopen", CanopenOptions)
        frames = plan_network(robot, options).frames_per_sync
    except RobotdError as error:
        yield Finding("warning", f"{robot.name}: {error}")
        return
    bus = options.bus
    if bus.interface == "socketcan" and bus.channel not in names:
        advice = f"available: {', '.join(names) or 'none'}; --set backends.canopen.bus.channel=NAME"
        yield Finding("failed", f"{robot.name}: no CAN interface {bus.channel!r}", advice)
    else:
        yield Finding("ok", f"{robot.name}: {bus.interface}:{bus.channel}")
        if bus.interface == "socketcan":
            yield _queue(str(bus.channel), frames)
        elif bus.interface not in {*DISCARDING, *QUEUELESS}:
            text = f"{robot.name}: {bus.interface} cannot discard frames that wait while the bus is"
            advice = "drives execute up to three setpoints late: use its SocketCAN driver"
            yield Finding("warning", f"{text} blocked", advice)


def _queue(name: str, frames: int) -> Finding:
    """Return whether frames of the past could wait in an interface, for ``frames`` each period."""
    kind, limit = _queueing(name)
    best = QUEUE_PERIODS * frames
    advice = f"sudo tc qdisc replace dev {name} root {QUEUE} limit {best}"
    if kind != QUEUE:
        text = (
            f"{name} keeps the oldest frames while the bus is blocked ({kind or 'queue unknown'})"
        )
        return Finding("warning", f"{text}: drives would execute them late", advice)
    if not frames <= limit <= best:
        text = f"{name} queues {limit} frames; one period has {frames}, two are enough"
        return Finding("warning", text, advice)
    return Finding("ok", f"{name} queues {limit} frames, and drops the oldest")


def _details(name: str) -> dict[str, Any]:
    """Return what ``ip`` tells about an interface; empty where it fails."""
    return _first("ip", "-details", "-json", "link", "show", "dev", name)


def _queueing(name: str) -> tuple[str, int]:
    """Return discipline and limit, frames, of the queue of an interface; "", 0: not known."""
    found = _first("tc", "-json", "qdisc", "show", "dev", name, "root")
    return found.get("kind", ""), found.get("options", {}).get("limit", 0)


def _first(*command: str) -> dict[str, Any]:
    """Return the first object that a command prints in JSON; empty where it fails."""
    try:
        done = subprocess.run(  # noqa: S603 - an interface that exists
            command, capture_output=True, text=True, timeout=TOOL_S, check=True
        )
        found, *_ = json.loads(done.stdout)
    except (OSError, subprocess.SubprocessError, ValueError):
        return {}
    return dict(found)


def _read(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""
