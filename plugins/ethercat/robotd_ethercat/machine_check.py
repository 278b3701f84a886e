"""Readiness of a machine and of a network interface for EtherCAT: ``robotd ethercat doctor``."""

from __future__ import annotations

import importlib.util
import os
import platform
import re
import shutil
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

from robotd.api import Finding, MachineContext, RobotdError, RobotDescriptor, validate_section
from robotd_ethercat.network_interface import may_open_raw_sockets
from robotd_ethercat.soem import INSTALL

NETWORK = Path("/sys/class/net")
REALTIME, ISOLATED = Path("/sys/kernel/realtime"), Path("/sys/devices/system/cpu/isolated")
_OFFLOADS = ("generic-receive-offload", "large-receive-offload", "tcp-segmentation-offload")
_COALESCING = re.compile(r"^(rx|tx)-usecs:\s*(\d+)", re.MULTILINE)
_PAUSED = re.compile(r"^RX(?: negotiated)?:\s*(on|off)", re.MULTILINE)
_TOOL_S = 5.0


def checks(context: MachineContext) -> Iterator[Finding]:
    """Yield the findings for the interface of the options, or those of the robots.

    With ``asks_devices`` the slaves go to PreOp, where nothing else has failed.
    """
    named = context.options.get("interface")
    found = [named] if named else [*map(_interface_of, context.robots)]
    interfaces: list[str | None] = [finding for finding in found if finding]
    for interface in interfaces or [None]:
        has_failed = False
        for finding in check_machine(interface):
            has_failed |= finding.verdict == "failed"
            yield finding
        if context.asks_devices and interface is not None and not has_failed:
            yield from _slaves(interface)


def _interface_of(robot: RobotDescriptor) -> str | None:
    from robotd_ethercat.options import EthercatOptions

    try:
        return validate_section(robot, "backends.ethercat", EthercatOptions).interface
    except RobotdError:
        return None  # of a robot on another backend


def _slaves(interface: str) -> Iterator[Finding]:
    from robotd_ethercat.bus_scan import open_bus, scan_bus

    with open_bus(interface) as bus:
        found = scan_bus(bus)
    for slave in found:
        yield Finding("ok" if slave.state == "PreOp" else "failed", str(slave))
    if not found:
        yield Finding("failed", "no slave answers", "check power and the cable to its IN port")


def check_machine(interface: str | None) -> Iterator[Finding]:
    """Yield all findings that need no slave; None: with every interface that could be meant."""
    yield _library()
    yield _permission()
    yield _kernel()
    yield _cores()
    if interface is None:
        yield from _candidates()
        return
    if interface not in {name for _, name in socket.if_nameindex()}:
        known = ", ".join(name for _, name in socket.if_nameindex())
        yield Finding("failed", f"no interface {interface!r}", f"available: {known}")
        return
    yield from _link(interface)
    yield from _settings(interface)


def _library() -> Finding:
    if importlib.util.find_spec("pysoem") is None:
        return Finding("failed", "pysoem is not installed", INSTALL)
    import pysoem

    return Finding("ok", f"pysoem {pysoem.__version__}, which contains SOEM")


def _permission() -> Finding:
    if may_open_raw_sockets():
        return Finding("ok", "raw sockets allowed")
    advice = "run as root, or grant the process CAP_NET_RAW (robotd docs how-to/ethercat)"
    return Finding("failed", "CAP_NET_RAW missing: no raw sockets", advice)


def _kernel() -> Finding:
    release = platform.release()
    if REALTIME.exists():
        return Finding("ok", f"real-time kernel, Linux {release}")
    advice = "fit for 250 to 500 Hz; for 1 kHz install a kernel with PREEMPT_RT"
    return Finding("warning", f"no real-time kernel, Linux {release}", advice)


def _cores() -> Finding:
    count = os.cpu_count() or 1
    isolated = ISOLATED.read_text().strip() if ISOLATED.exists() else ""
    if isolated:
        return Finding("ok", f"{count} cores, isolated: {isolated}")
    advice = "isolcpus= keeps other programs from a core; run robotd on it with taskset"
    return Finding("warning" if count > 1 else "failed", f"{count} cores, none isolated", advice)


def _candidates() -> Iterator[Finding]:
    """Wired interfaces of this computer. One with an address carries other traffic."""
    names = [name for _, name in socket.if_nameindex() if name != "lo"]
    wired = [name for name in names if not (NETWORK / name / "wireless").exists()]
    for name in wired:
        state = _read(NETWORK / name / "operstate") or "unknown"
        if address := _address(name):
            text = f"{name} ({state}) has address {address}"
            yield Finding("warning", text, "it carries other traffic: not an interface for a bus")
        else:
            yield Finding("ok", f"{name} ({state}) has no address", f"--interface {name} checks it")
    if not wired:
        advice = "EtherCAT needs a network card of its own"
        yield Finding("failed", "no wired network interface", advice)


def _address(interface: str) -> str:
    """Return the first IPv4 address of ``interface``; "" without one."""
    addresses = _tool("ip", "-brief", "address", "show", "dev", interface).split()[2:]
    return next((address for address in addresses if "." in address), "")


def _link(interface: str) -> Iterator[Finding]:
    folder = NETWORK / interface
    state = _read(folder / "operstate")
    if state == "down":
        advice = f"connect the cable of the first slave; sudo ip link set {interface} up"
        yield Finding("failed", f"{interface} is down", advice)
    else:
        yield Finding("ok", f"{interface} is {'up' if state == 'up' else 'present'}")
    device = folder / "device"  # a virtual interface has none, and any speed
    speed = _read(folder / "speed") if device.exists() else ""
    if speed.isdigit() and speed != "100":
        advice = "EtherCAT runs at 100 Mbit/s: is a slave connected, and no switch between?"
        yield Finding("warning", f"{interface} runs at {speed} Mbit/s", advice)
    driver = device / "driver"
    if driver.exists():
        yield Finding("ok", f"driver {driver.resolve().name}")
    if address := _address(interface):
        advice = "other traffic delays the frames: remove the address, and let no DHCP run on it"
        yield Finding("warning", f"{interface} has address {address}", advice)


def _settings(interface: str) -> Iterator[Finding]:
    """Offloads, flow control and IRQ coalescing, by ``ethtool``."""
    if shutil.which("ethtool") is None:
        yield Finding(
            "warning", "no ethtool: offloads and coalescing unknown", "apt install ethtool"
        )
        return
    features = _tool("ethtool", "-k", interface)
    active = [name for name in _OFFLOADS if re.search(rf"^{name}: on", features, re.MULTILINE)]
    if active:
        advice = f"they delay frames: sudo ethtool -K {interface} gro off lro off tso off"
        yield Finding("warning", f"offloads on: {', '.join(active)}", advice)
    else:
        yield Finding("ok", "offloads off")
    paused = _PAUSED.findall(_tool("ethtool", "-a", interface))
    if paused and paused[-1] == "on":
        advice = f"frames would wait, and be executed late: sudo ethtool -A {interface} rx off"
        yield Finding("warning", "flow control on: another device may hold frames up", advice)
    waits = {kind: int(us) for kind, us in _COALESCING.findall(_tool("ethtool", "-c", interface))}
    if any(waits.values()):
        text = ", ".join(f"{kind} {us} µs" for kind, us in waits.items())
        advice = f"each frame waits so long: sudo ethtool -C {interface} rx-usecs 0 tx-usecs 0"
        yield Finding("warning", f"IRQ coalescing: {text}", advice)
    elif waits:
        yield Finding("ok", "no IRQ coalescing")


def _read(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""


def _tool(*command: str) -> str:
    """Output of a command line tool; "" where it fails."""
    try:
        done = subprocess.run(  # noqa: S603 - fixed commands, an interface that exists
            command, capture_output=True, text=True, timeout=_TOOL_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout
