"""``robotd backends``: list the installed backends, or check one."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any, TypeVar

import click

from robotd.api import API_VERSION, Capability, ConnectionState, DeviceContext, PluginError
from robotd.api.commands import (
    CheckReport,
    ExitCode,
    as_json,
    installed_names,
    load_robot,
    log_options,
)
from robotd.api.models import parse_override
from robotd.api.robots import Backend, discover, load_backend
from robotd_inventory.listing import Row, print_rows
from robotd_shared.foreign_process import (
    BackendSummary,
    death_of,
    is_foreign,
    note_step,
    probe_backend,
    run_noted,
)

ROBOT = "standalone"  # bare axes: most backends can be made for them
SLOW_S = 1.0  # of processor time: a hook or an import that takes more delays every start
WAITS_S = 5.0  # by the clock, on a machine that may be busy

Made = TypeVar("Made")


@click.command("backends")
@as_json
@click.option("--check", "checked", metavar="NAME", help="Examine one backend, without hardware.")
@click.option(
    "--robot",
    metavar="NAME|FILE",
    default=ROBOT,
    show_default=True,
    help="Robot that --check makes the drivers for.",
)
@click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    multiple=True,
    help="Replace a value of that robot's file. May be repeated.",
)
@log_options
def backends(
    *, as_json: bool, checked: str | None, robot: str, overrides: Sequence[str]
) -> ExitCode:
    """List the installed backends, and why one cannot load."""
    if checked is not None:
        return check_backend(checked, robot, overrides)
    rows = []
    names = installed_names("robotd.backends")
    for origin in sorted([*names.refused, *(origin for origin, _ in names.entries.values())]):
        row: Row = {
            "name": origin.name,
            "summary": "",
            "capabilities": [],
            "api_version": None,
            "distribution": origin.distribution,
            "version": origin.version,
            "problem": None,
        }
        if origin in names.refused:
            rows.append(row | {"problem": names.refused[origin]})
            continue
        # A foreign one in a process of its own, which it may end.
        describe = probe_backend if is_foreign(origin) else BackendSummary.of
        try:
            row |= asdict(describe(origin.name))
        except PluginError as error:
            row["problem"] = str(error)
        rows.append(row)
    print_rows(rows, ("capabilities", "api_version", "distribution", "version"), as_json=as_json)
    return ExitCode.OK


def check_backend(name: str, robot: str = ROBOT, overrides: Sequence[str] = ()) -> ExitCode:
    """Check the backend ``name`` step by step, print each, and return the exit status.

    A foreign plugin is checked in a process of its own, which it may end.

    Args:
        robot: name or file of the robot that its drivers are made for.
        overrides: ``KEY=VALUE`` texts that replace values of its file.
    """
    origins = [origin for origin, _ in discover() if origin.name == name]
    if not any(map(is_foreign, origins)):
        return _check_here(name, robot, *overrides)
    command = [sys.executable, "-m", __name__, name, robot, *overrides]
    status, output, step = run_noted(command, capture=True)
    click.echo(output, nl=False)
    if step == "done":
        return ExitCode(status)
    report = CheckReport()
    report.fail(step, death_of(name, status, step))
    return report.end()


def _check_here(name: str, robot: str, *overrides: str) -> ExitCode:
    report = CheckReport()
    report.run("entry point", lambda: _origins(name))
    backend = report.run(
        "import, hooks, API version", lambda: _timed("the import", lambda: load_backend(name))
    )
    if backend is not None:
        report.run("description", lambda: _description(backend))

        def options() -> DeviceContext[Any]:
            changes = [parse_override(text) for text in overrides]
            return backend.context(load_robot(robot, overrides=changes))

        context = report.run("options", options)
        if context is not None:
            _check_drivers(report, backend, context)
    return report.end()


def _origins(name: str) -> str:
    origins = [str(origin) for origin, _ in discover() if origin.name == name]
    return " and ".join(origins) or "none of that name"


def _description(backend: Backend) -> str:
    can = ", ".join(sorted(backend.capabilities))
    return f"{backend.info.summary}; API {backend.info.api_version} (this is {API_VERSION}); {can}"


def _check_drivers(report: CheckReport, backend: Backend, context: DeviceContext[Any]) -> None:
    """Make every driver as the start-up does; nothing is opened."""
    drivers = report.run(
        "drivers", lambda: _timed("making the drivers", lambda: backend.drivers(context))
    )
    if drivers is None:
        return
    report.run("state before open", lambda: _idle(backend, drivers.device.state()))
    report.run("I/O", lambda: _presence(drivers.io))
    report.run("fieldbus", lambda: _presence(drivers.fieldbus))
    report.run("fault injector", lambda: _presence(drivers.make_fault_injector()))
    report.run("arguments of methods", lambda: _arguments(backend, drivers.signature_problems()))
    report.run("capabilities", lambda: _undeclared(drivers.undeclared(backend.info.capabilities)))
    if Capability.SIMULATED not in backend.capabilities:
        report.run("real hardware", lambda: "robotd conform moves its axes: read the docs first")


def _idle(backend: Backend, state: ConnectionState) -> str:
    if state is not ConnectionState.IDLE:
        raise PluginError(
            f"plugin {backend.origin}: the device is {state.value} before it was opened,"
            f" not {ConnectionState.IDLE.value}"
        )
    return str(state.value)


def _arguments(backend: Backend, problems: Sequence[str]) -> None:
    if problems:
        lines = (f"plugin {backend.origin}: {problem}" for problem in problems)
        raise PluginError("\n".join(lines))


def _presence(made: object) -> str:
    return "none" if made is None else "present"


def _undeclared(found: Sequence[str]) -> str | None:
    return f"implemented, but not declared: {', '.join(found)}" if found else None


def _timed(what: str, make: Callable[[], Made]) -> Made:
    """Return what ``make`` makes. Raises PluginError when that was slow.

    Processor time distinguishes a slow plugin from a loaded machine; time by the clock finds one
    that waits for something.
    """
    note_step(what)
    began_s, began_cpu_s = time.monotonic(), time.process_time()
    made = make()
    took_s, took_cpu_s = time.monotonic() - began_s, time.process_time() - began_cpu_s
    for passed_s, limit_s, kind in (
        (took_cpu_s, SLOW_S, " of processor time"),
        (took_s, WAITS_S, ""),
    ):
        if passed_s > limit_s:
            raise PluginError(
                f"{what} took {passed_s:.1f} s{kind}; more than {limit_s:g} s delays every start"
            )
    return made


if __name__ == "__main__":
    status = _check_here(*sys.argv[1:])
    sys.stdout.flush()
    note_step("done")
    os._exit(status)  # threads of the plugin may go on for ever
