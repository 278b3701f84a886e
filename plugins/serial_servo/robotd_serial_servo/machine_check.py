"""Readiness of a computer for serial adapters: ports, rights, latency timers, ModemManager."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from robotd.api import Finding, MachineContext, RobotdError, RobotDescriptor, validate_section
from robotd_serial_servo.options import SerialServoOptions

DEVICES = Path("/dev")
SYSTEM = Path("/sys/class/tty")
PROCESSES = Path("/proc")
PATTERNS = ("ttyACM*", "ttyUSB*")
BEST_LATENCY_MS = 1


def port_checks(
    context: MachineContext, options: type[SerialServoOptions], backend: str
) -> Iterator[Finding]:
    """Yield the findings; nothing is opened and nothing is sent."""
    if importlib.util.find_spec("serial") is None:
        yield Finding("failed", "pyserial is not installed", f"pip install 'robotd[{backend}]'")
    found = sorted(path for pattern in PATTERNS for path in DEVICES.glob(pattern))
    named = [path for robot in context.robots if (path := _port(robot, options))]
    if not found and not named:
        yield Finding("warning", "no serial adapter", "plug it in; ls /dev/serial/by-id names it")
    for path in dict.fromkeys((*found, *named)):
        yield from _check_port(path)
    if "ModemManager" in _running():
        advice = (
            "sudo systemctl disable --now ModemManager, or a udev rule with ID_MM_DEVICE_IGNORE"
        )
        text = "ModemManager runs: it opens new serial ports and talks to them for seconds"
        yield Finding("warning", text, advice)


def _check_port(path: Path) -> Iterator[Finding]:
    if not path.exists():
        advice = "plug it in; a link in /dev/serial/by-id keeps its name"
        yield Finding("failed", f"{path} is not there", advice)
        return
    if not os.access(path, os.R_OK | os.W_OK):
        advice = f"sudo usermod -aG {_group(path)} $USER, then log in again"
        yield Finding("failed", f"{path}: no right to open it", advice)
        return
    name = path.resolve().name
    timer = SYSTEM / name / "device" / "latency_timer"
    with suppress(OSError, ValueError):
        latency_ms = int(timer.read_text())
        if latency_ms > BEST_LATENCY_MS:
            text = f"{path}: the adapter holds replies back for {latency_ms} ms"
            yield Finding("warning", text, f"echo {BEST_LATENCY_MS} | sudo tee {timer}")
            return
    yield Finding("ok", f"{path} can be opened")


def _port(robot: RobotDescriptor, options: type[SerialServoOptions]) -> Path | None:
    with suppress(RobotdError):
        port = validate_section(robot, options.section, options).port
        return Path(port) if port else None
    return None


def _group(path: Path) -> str:
    try:
        return path.group()
    except (KeyError, OSError):
        return "dialout"


def _running() -> set[str]:
    names = set()
    for file in PROCESSES.glob("[0-9]*/comm"):
        with suppress(OSError):
            names.add(file.read_text().strip())
    return names
