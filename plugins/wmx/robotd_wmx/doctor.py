"""The backend's part of ``robotd wmx doctor``: the binding, and the engine on request.

It moves nothing, switches nothing on and starts no communication.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from robotd.api import Finding, MachineContext
from robotd_wmx import _native
from robotd_wmx._native import CallError, Device, Master, Snapshot
from robotd_wmx.errors import LOCKED, name_of, names, table, text_of

STATES = {0: "none", 1: "Init", 2: "Preop", 4: "Boot", 8: "Safeop", 16: "Op"}
NO_PROGRAM = frozenset({"RtssFileNotFoundError", "RtssStartError", "StartProcessFailed"})


def checks(context: MachineContext) -> Iterator[Finding]:
    """Yield the findings of the backend; option ``sdk``: root of the SDK."""
    root = Path(context.options["sdk"]) if "sdk" in context.options else None
    yield from check_binding(root)
    if context.asks_devices:
        yield from check_engine(root or Path(_native.SDK_PATH))


def check_binding(root: Path | None) -> Iterator[Finding]:
    """Check that the binding loads and matches the inspected SDK."""
    version = ".".join(map(str, _native.library_version()))
    built = Path(_native.SDK_PATH)
    yield Finding("ok", f"binding built against {built}, library {version}")
    if root is not None and root.resolve() != built.resolve():
        advice = f"WMX3_SDK_PATH={root} pip install --force-reinstall --no-deps ./plugins/wmx"
        yield Finding("failed", f"the binding belongs to {built}, not to {root}", advice)
    elif not built.is_dir():
        yield Finding(
            "failed", f"the SDK of the binding is gone: {built}", "build the backend again"
        )
    yield Finding("ok", f"{_native.MAX_AXES} axes, {_native.MAX_SPLINE_AXES} in one spline")
    codes = names()
    moved = [
        f"{name} {code} (table: {row.code})"
        for (api, code), name in codes.items()
        if (row := table()[api, name]).code not in (code, 0)
    ]
    unknown = [row for row in table().values() if row.code and (row.api, row.code) not in codes]
    if moved or unknown:
        text = f"{len(moved)} error codes have other numbers, {len(unknown)} are unknown here"
        examples = ", ".join([*moved[:5], *(row.name for row in unknown[:5])])
        yield Finding("warning", f"{text}: {examples}", "send this line back")
    else:
        yield Finding("ok", "error codes are those of the table")


def check_engine(root: Path) -> Iterator[Finding]:
    """A device is created and closed; status, licence and network are read."""
    device = Device()
    try:
        device.create(f"{root}/", 10_000)
    except CallError as error:
        yield Finding("failed", f"engine: {text_of(*error.args[1:3])}", _advice(error, root))
        return
    try:
        device.set_name("robotd doctor")
        yield Finding("ok", f"engine {device.state().name.lower()}")
        listed = ", ".join(name or "unnamed" for _, name in device.devices())
        yield Finding("ok", f"devices: {listed}")
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


def _advice(error: CallError, root: Path) -> str:
    name = name_of(error)
    if name in LOCKED:
        return "another program is starting the engine or uses it: end it, or try again"
    if name in NO_PROGRAM:
        return f"the engine's program is missing or cannot be started: is {root} a complete SDK?"
    return "run as root; the engine's own log says more"


def _network(device: Device, number: int) -> Iterator[Finding]:
    try:
        info = Master(device, number)
    except CallError as error:
        if number and name_of(error) == "IDOutOfRange":
            return  # one master is the usual case
        yield Finding("warning", f"master {number}: {text_of(*error.args[1:3])}")
        return
    what = f"master {number}: {STATES.get(info.state, info.state)}, {len(info.slaves)} slaves"
    lost = [slave for slave in info.slaves if slave.offline or slave.state == 0]
    if not info.slaves:
        advice = "cable, power of the drives, network card, ENI file; known only after a scan"
        yield Finding("warning", what, advice)
    elif lost:
        silent = ", ".join(str(slave.id) for slave in lost)
        yield Finding(
            "warning", f"{what}, no answer from {silent}", "cable and power of these slaves"
        )
    else:
        states = ", ".join(f"{slave.id} {STATES.get(slave.state, '?')}" for slave in info.slaves)
        yield Finding("ok", f"{what}: {states}")
