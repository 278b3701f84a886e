"""``robotd backends --check NAME``: what can be wrong with a backend, without hardware or ROS."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

from robotd.cli.findings import Findings
from robotd.descriptor import load_robot_descriptor
from robotd.device.capabilities import Capability
from robotd.device.state import ConnectionState
from robotd.errors import PluginError
from robotd.plugin.hookspecs import API_VERSION, DeviceContext
from robotd.plugin.manager import Backend, discover, load_backend

ROBOT = "standalone"  # bare axes: any backend can be made for them
SLOW_S = 1.0  # a hook that takes longer makes every start wait

Made = TypeVar("Made")


def check_backend(name: str) -> int:
    """Look at the backend ``name`` step by step, print each, and return the exit status."""
    findings = Findings()
    findings.run("entry point", lambda: _origins(name))
    backend = findings.run(
        "import, hooks, API version", lambda: _timed("the import", lambda: load_backend(name))
    )
    if backend is not None:
        findings.run("description", lambda: _description(backend))
        context = findings.run("options", lambda: _context(backend))
        if context is not None:
            _check_drivers(findings, backend, context)
    return findings.end()


def _origins(name: str) -> str:
    origins = [str(origin) for origin, _ in discover() if origin.name == name]
    return " and ".join(origins) or "none of that name"


def _description(backend: Backend) -> str:
    info = backend.info
    if Capability.AXES not in info.capabilities:
        raise PluginError(f"plugin {backend.origin} does not declare the capability 'axes'")
    can = ", ".join(sorted(info.capabilities))
    return f"{info.summary}; API {info.api_version} (this is {API_VERSION}); {can}"


def _context(backend: Backend) -> DeviceContext:
    robot = load_robot_descriptor(ROBOT)
    return DeviceContext(robot, backend.options(robot))


def _check_drivers(findings: Findings, backend: Backend, context: DeviceContext) -> None:
    """Make every driver as the start-up does; nothing is opened."""
    device = findings.run(
        "robotd_open_device",
        lambda: _timed("robotd_open_device", lambda: backend.open_device(context)),
    )
    if device is None:
        return
    findings.run("state before open", lambda: _idle(backend, device.state()))
    io, fieldbus = Capability.IO, Capability.FIELDBUS
    declared = backend.info.capabilities
    findings.run("robotd_axes", lambda: _there(backend.axes(device, context)))
    findings.run("robotd_io", lambda: _agrees(backend, io, backend.io(device, context)))
    findings.run(
        "robotd_fieldbus", lambda: _agrees(backend, fieldbus, backend.fieldbus(device, context))
    )
    findings.run("robotd_fault_injector", lambda: _there(backend.fault_injector(device, context)))
    if Capability.SIMULATED not in declared:
        findings.run("real hardware", lambda: "robotd conform moves its axes: read the docs first")


def _idle(backend: Backend, state: ConnectionState) -> str:
    if state is not ConnectionState.IDLE:
        raise PluginError(
            f"plugin {backend.origin}: the device is {state.value} before it was opened,"
            f" not {ConnectionState.IDLE.value}"
        )
    return str(state.value)


def _there(made: object) -> str:
    return "none" if made is None else "there"


def _agrees(backend: Backend, capability: Capability, made: object) -> str:
    """A driver is there exactly where it was declared. Raises PluginError."""
    if (made is not None) is not (capability in backend.info.capabilities):
        says = "declares" if made is None else "does not declare"
        has = "makes no driver" if made is None else "makes a driver"
        raise PluginError(f"plugin {backend.origin} {says} '{capability}' and {has} for it")
    return _there(made)


def _timed(what: str, make: Callable[[], Made]) -> Made:
    """What ``make`` makes. Raises PluginError when it was slow."""
    began_s = time.monotonic()
    made = make()
    took_s = time.monotonic() - began_s
    if took_s > SLOW_S:
        raise PluginError(f"{what} took {took_s:.1f} s; more than {SLOW_S:g} s delays every start")
    return made
