"""``robotd sim``: run a scenario, and reach into a simulation that runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from robotd.cli.catalogue import load_catalogue
from robotd.cli.exit_codes import ExitCode
from robotd.cli.preflight import import_ros
from robotd.descriptor import load_robot_descriptor
from robotd.errors import DescriptorError
from robotd.plugin.manager import load_backend
from robotd.scenario import FAULTS, Result, ScenarioRun, load_scenario


def run_scenario(file: Path, robot: str | None, scale: float | None) -> int:
    """Run it, telling each step; returns the exit status."""
    scenario = load_scenario(file)
    robot = robot or scenario.robot
    if robot is None:
        raise DescriptorError("names no robot, and none is given by --robot", path=file)
    search_path = load_catalogue().search_path
    descriptor = load_robot_descriptor(robot, scenario.variant, search_path)
    backend = load_backend(scenario.backend)
    run = ScenarioRun(scenario, descriptor, backend, math.inf if scale is None else scale)
    for done in run.steps():
        mark = click.style("ok  ", fg="green") if done.failure is None else _failed()
        click.echo(f"{done.time_s:9.3f} s  {mark}  {done.step}")
    _tell(run.result)
    return ExitCode.FAILED if run.result.failures else ExitCode.OK


def inject_fault(
    ros_args: Sequence[str], timeout_s: float, fault: str, words: Sequence[str]
) -> None:
    """Ask the running simulation for a fault. Raises OperationError with its rejection."""
    values = dict(_value(word) for word in words)
    if fault not in FAULTS:
        raise click.BadParameter(f"{fault!r} is none of {', '.join(FAULTS)}")
    # What belongs to every fault, and what to this kind.
    common = {key: values.pop(key) for key in list(values) if key.split(".")[0] in ("at_s", "when")}
    fields = {f"{fault}.{key}": value for key, value in values.items()} or {fault: True}
    client = import_ros("client.simulation_client")
    click.echo(client.inject(ros_args, timeout_s, {**fields, **common}))


def step_time(ros_args: Sequence[str], timeout_s: float, periods: int) -> None:
    """Let periods pass; returns when they are over."""
    click.echo(import_ros("client.simulation_client").step(ros_args, timeout_s, periods))


def pause_time(ros_args: Sequence[str], timeout_s: float, *, paused: bool) -> None:
    """Let time stand, or pass again."""
    click.echo(import_ros("client.simulation_client").pause(ros_args, timeout_s, paused=paused))


def _value(word: str) -> tuple[str, Any]:
    """``key=value`` with the value as a bool, an int, a float or text."""
    key, _, text = word.partition("=")
    if not (key and text):
        raise click.BadParameter(f"{word!r} is not like axis=2")
    if text in ("true", "false"):
        return key, text == "true"
    for number in (lambda text: int(text, 0), float):
        try:
            return key, number(text)
        except ValueError:
            continue
    return key, text


def _failed() -> str:
    return click.style("FAIL", fg="red", bold=True)


def _tell(result: Result) -> None:
    for each in result.faults:
        what = "over: " if each.over else ""
        click.echo(f"{each.time_s:9.3f} s  fault  {what}{each.fault}")
    for failure in result.failures:
        click.echo(f"{_failed()}  {failure}")
    speed = result.simulated_s / result.real_s if result.real_s > 0 else math.nan
    click.echo(
        f"{result.simulated_s:.3f} s simulated in {result.real_s:.3f} s ({speed:.1f} times real"
        f" time), {result.periods} periods, joint states {result.digest[:16]}"
    )
    if not result.failures:
        click.echo("passed")
