"""``robotd sim``: run a scenario, and control a running simulation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.group import ros_args
from robotd.cli.installed import load_installed
from robotd.cli.options import FILE, configure_logging, log_options
from robotd.cli.preflight import import_ros
from robotd.cli.robot_client import ROS_EPILOG, client_options
from robotd.cli.time_scale import time_scale
from robotd.descriptor import load_robot_descriptor
from robotd.errors import DescriptorError
from robotd.plugin.manager import load_backend
from robotd.scenario import FAULTS, Result, ScenarioRun, load_scenario

MAX_STEPS = 1_000_000


@click.group("sim")
def sim() -> None:
    """Scenarios and faults for the simulation."""


@sim.command("run")
@click.argument("file", required=False, type=FILE)
@click.option("--robot", metavar="NAME|FILE", help="The robot; by default the scenario's own.")
@click.option(
    "--from",
    "recording",
    metavar="FILE",
    type=FILE,
    help="Instead of a scenario: repeat the commands of a recording, and compare the motion.",
)
@time_scale
@log_options
@click.pass_context
def run(
    ctx: click.Context,
    /,
    file: Path | None,
    robot: str | None,
    recording: Path | None,
    *,
    time_scale: float | None,
) -> None:
    """Run a scenario as a test: status 0 when it passes, else 1.

    Without ROS, and as fast as the computer goes unless --time-scale says otherwise.
    """
    configure_logging(ctx)
    if (file is None) is (recording is None):
        raise click.UsageError("either a scenario or --from FILE is needed")
    if recording is not None:
        from robotd.cli.recording_comparison import repeat_recording

        ctx.exit(repeat_recording(recording, robot))
    if file is not None:
        ctx.exit(run_scenario(file, robot, time_scale))


@sim.command("inject", epilog=ROS_EPILOG)
@click.argument("fault")
@click.argument("values", metavar="[KEY=VALUE]...", nargs=-1)
@client_options
@click.pass_context
def inject(ctx: click.Context, /, fault: str, values: tuple[str, ...], *, timeout_s: float) -> None:
    """Inject a fault into the running simulation.

    For example: robotd sim inject amp_alarm axis=2 at_s=1.5. The robot has to be run with
    --time-scale or --scenario.
    """
    configure_logging(ctx)
    inject_fault(ros_args(ctx), timeout_s, fault, values)


@sim.command("step", epilog=ROS_EPILOG)
@click.argument("periods", type=click.IntRange(1, MAX_STEPS), default=1)
@client_options
@click.pass_context
def step(ctx: click.Context, /, periods: int, *, timeout_s: float) -> None:
    """Run PERIODS control periods in the running simulation, then pause its time."""
    configure_logging(ctx)
    step_time(ros_args(ctx), timeout_s, periods)


@sim.command("pause", epilog=ROS_EPILOG)
@client_options
@click.pass_context
def pause(ctx: click.Context, /, *, timeout_s: float) -> None:
    """Pause the time of the running simulation."""
    configure_logging(ctx)
    pause_time(ros_args(ctx), timeout_s, paused=True)


@sim.command("resume", epilog=ROS_EPILOG)
@client_options
@click.pass_context
def resume(ctx: click.Context, /, *, timeout_s: float) -> None:
    """Resume the time of the running simulation."""
    configure_logging(ctx)
    pause_time(ros_args(ctx), timeout_s, paused=False)


def run_scenario(file: Path, robot: str | None, scale: float | None) -> int:
    """Run it, print each step, and return the exit status."""
    scenario = load_scenario(file)
    robot = robot or scenario.robot
    if robot is None:
        raise DescriptorError("names no robot, and none is given by --robot", path=file)
    search_path = load_installed().search_path
    descriptor = load_robot_descriptor(robot, scenario.variant, search_path)
    backend = load_backend(scenario.backend)
    run = ScenarioRun(scenario, descriptor, backend, math.inf if scale is None else scale)
    for done in run.steps():
        mark = click.style("ok  ", fg="green") if done.failure is None else _failed()
        click.echo(f"{done.time_s:9.3f} s  {mark}  {done.step}")
    _tell(run.result)
    return ExitCode.FAILED if run.result.failures else ExitCode.OK


def inject_fault(
    arguments: Sequence[str], timeout_s: float, fault: str, words: Sequence[str]
) -> None:
    """Ask the running simulation for a fault. Raises OperationError with its rejection."""
    values = dict(_value(word) for word in words)
    if fault not in FAULTS:
        raise click.BadParameter(f"{fault!r} is none of {', '.join(FAULTS)}")
    # What belongs to every fault, and what to this kind.
    common = {key: values.pop(key) for key in list(values) if key.split(".")[0] in ("at_s", "when")}
    fields = {f"{fault}.{key}": value for key, value in values.items()} or {fault: True}
    client = import_ros("client.simulation_client")
    click.echo(client.inject(arguments, timeout_s, {**fields, **common}))


def step_time(arguments: Sequence[str], timeout_s: float, periods: int) -> None:
    """Run control periods and wait until they have run."""
    click.echo(import_ros("client.simulation_client").step(arguments, timeout_s, periods))


def pause_time(arguments: Sequence[str], timeout_s: float, *, paused: bool) -> None:
    """Pause or resume simulated time."""
    click.echo(import_ros("client.simulation_client").pause(arguments, timeout_s, paused=paused))


def _value(word: str) -> tuple[str, Any]:
    """Parse ``key=value`` with the value as a bool, an int, a float or text."""
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
