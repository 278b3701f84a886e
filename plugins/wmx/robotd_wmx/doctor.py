"""Is this machine ready for the WMX backend? The checks of ``robotd wmx doctor``.

Runs on a machine with the SDK before anything else does. It moves nothing, switches nothing on
and starts no communication; with ``--engine`` it starts the engine if none runs. What it prints
is what to send to whoever is asked for help.
"""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from robotd_wmx._native import Device

LIBRARIES = ("wmx3api", "coremotionapi", "advancedmotionapi", "ioapi", "ecapi", "imdll")
REALTIME = Path("/sys/kernel/realtime")
LATENCY = Path("/dev/cpu_dma_latency")
CAP_SYS_NICE, CAP_IPC_LOCK = 23, 14  # linux/capability.h


class Finding(NamedTuple):
    """One line of the report. ``verdict``: ok, warning or failed."""

    verdict: str
    what: str
    advice: str = ""


Check = Callable[[Path], Iterator[Finding]]


def check_machine(root: Path) -> Iterator[Finding]:
    """Architecture, kernel and Python; nothing here can fail."""
    yield Finding("ok", f"{platform.machine()}, Linux {platform.release()}")
    yield Finding("ok", f"Python {platform.python_version()} at {sys.executable}")


def check_sdk(root: Path) -> Iterator[Finding]:
    """The SDK's folders and libraries."""
    if not root.is_dir():
        yield Finding("failed", f"no SDK at {root}", "install it, or set WMX3_SDK_PATH and rebuild")
        return
    yield Finding("ok", f"SDK at {root}")
    for name in LIBRARIES:
        found = sorted(path.name for path in (root / "lib").glob(f"lib{name}.*"))
        if found:
            yield Finding("ok", f"{name}: {', '.join(found)}")
        else:
            yield Finding("failed", f"no library {name} in {root / 'lib'}", "reinstall the SDK")


def check_binding(root: Path) -> Iterator[Finding]:
    """The compiled module loads and knows the SDK's errors."""
    from robotd_wmx import _native

    version = ".".join(map(str, _native.library_version()))
    yield Finding("ok", f"binding built against {_native.SDK_PATH}, library {version}")
    yield Finding("ok", f"{_native.MAX_AXES} axes, {_native.MAX_SPLINE_AXES} in one spline")
    from robotd_wmx.errors import names, table

    moved = [
        f"{name} {code} (table: {table()[api, name].code})"
        for (api, code), name in names().items()
        if table()[api, name].code != code
    ]
    missing = len(table()) - len(names())
    if moved or missing:
        text = f"{len(moved)} error codes have other numbers, {missing} names are unknown here"
        yield Finding("warning", f"{text}: {', '.join(moved[:5])}", "send this line back")
    else:
        yield Finding("ok", "error codes are those of the table")


def check_permissions(root: Path) -> Iterator[Finding]:
    """Root or capabilities, and what a real-time process needs."""
    wanted = "run as root, or give the Python program the capabilities (docs/how-to/wmx.md)"
    if os.geteuid() == 0:
        yield Finding("ok", "running as root")
    else:
        for bit, name in (CAP_SYS_NICE, "CAP_SYS_NICE"), (CAP_IPC_LOCK, "CAP_IPC_LOCK"):
            present = bool(_capabilities() >> bit & 1)
            yield Finding(
                "ok" if present else "warning",
                f"{name} {'present' if present else 'missing'}",
                "" if present else wanted,
            )
    if os.access(LATENCY, os.W_OK):
        yield Finding("ok", f"{LATENCY} writable")
    else:
        yield Finding("warning", f"{LATENCY} not writable: cores may sleep", wanted)
    if REALTIME.exists():
        yield Finding("ok", "real-time kernel")
    else:
        yield Finding("warning", "no real-time kernel", "the vendor recommends PREEMPT_RT")


def check_engine(root: Path) -> Iterator[Finding]:
    """A device is created and closed; status, licence and network are read."""
    from robotd_wmx import _native
    from robotd_wmx._native import CallError, Device, Snapshot
    from robotd_wmx.errors import text_of

    device = Device()
    try:
        device.create(f"{root}/", 10_000)
    except CallError as error:
        yield Finding("failed", f"engine: {text_of(*error.args[1:3])}", "is another program on it?")
        return
    try:
        device.set_name("robotd doctor")
        yield Finding("ok", f"engine {device.state().name.lower()}")
        names = [name or "unnamed" for _, name in device.devices()]
        yield Finding("ok", f"devices: {', '.join(names)}")
        if Snapshot(device).licence_invalid:
            advice = "without a licence communication ends after an hour"
            yield Finding("warning", "the engine reports no valid licence", advice)
        else:
            yield Finding("ok", "licence: no complaint from the engine")
        for number in range(_native.MAX_MASTERS):
            yield from _network(device, number)
    except CallError as error:
        yield Finding("failed", f"engine: {text_of(*error.args[1:3])} from {error.args[0]}")
    finally:
        device.close(False)


def _network(device: Device, number: int) -> Iterator[Finding]:
    from robotd_wmx._native import CallError, Master
    from robotd_wmx.errors import name_of, text_of

    try:
        info = Master(device, number)
    except CallError as error:
        if number and name_of(error) == "IDOutOfRange":
            return  # one master is the usual case
        yield Finding("warning", f"master {number}: {text_of(*error.args[1:3])}")
        return
    states = ", ".join(f"{slave.id}: state {slave.state}" for slave in info.slaves) or "no slaves"
    yield Finding("ok", f"master {number}: state {info.state}; {states}")


def _capabilities() -> int:
    """The effective capabilities of this process, as a bit mask."""
    for line in Path("/proc/self/status").read_text("ascii").splitlines():
        if line.startswith("CapEff:"):
            return int(line.split()[1], 16)
    return 0


def report(root: Path | None, *, engine: bool) -> tuple[list[Finding], bool]:
    """All findings, and whether none failed. A check that breaks is a finding too."""
    findings: list[Finding] = []
    checks: list[Check] = [check_machine]
    try:
        from robotd_wmx import _native

        root = root or Path(_native.SDK_PATH)
        checks += [check_sdk, check_binding, check_permissions]
    except ImportError as error:
        advice = "pip install ./plugins/wmx on this machine"
        findings.append(Finding("failed", f"the binding does not load: {error}", advice))
        checks += [check_sdk, check_permissions]
    if engine and not findings:
        checks.append(check_engine)
    for check in checks:
        findings += check(root or Path("/opt/wmx3"))
    return findings, all(finding.verdict != "failed" for finding in findings)
