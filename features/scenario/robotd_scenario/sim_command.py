"""``robotd sim``: run a scenario, and control a running simulation and its objects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from robotd.api import DescriptorError
from robotd.api.commands import (
    FILE,
    ExitCode,
    IntegerRange,
    import_ros,
    load_robot,
    log_options,
    parse_integer,
    parse_number,
    time_scale,
)
from robotd.api.robots import load_backend
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    asks_robot,
    client_options,
    require_one_robot,
    robot_client,
)
from robotd_ros.node_names import WORLD_NODE
from robotd_scenario import FAULTS, Result, ScenarioRun, load_scenario
from robotd_scenario.feature import MAX_STEPS, SIMULATION_NODE, STEP_TIMEOUT_S

if TYPE_CHECKING:  # it needs rclpy
    from robotd_ros.client.ros_client import RosClient

COORDINATES = ("x", "y", "z")
ANGLES = ("roll", "pitch", "yaw")


@click.group("sim", epilog=ROS_EPILOG)
def sim() -> None:
    """Scenarios, faults and objects of the simulation."""


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
def run(
    file: Path | None, robot: str | None, recording: Path | None, time_scale: float | None
) -> ExitCode:
    """Run a scenario as a test: status 0 when it passes, else 1.

    Without ROS, and as fast as the computer goes unless --time-scale says otherwise.
    """
    if file is not None and recording is None:
        return run_scenario(file, robot, time_scale)
    if recording is not None and file is None:
        from robotd_scenario.recording_comparison import repeat_recording

        return repeat_recording(recording, robot)
    raise click.UsageError("either a scenario or --from FILE is needed")


def _complete_fault(
    ctx: click.Context, argument: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    return [CompletionItem(name) for name in FAULTS if name.startswith(incomplete)]


@sim.command("inject", epilog=ROS_EPILOG)
@click.argument("fault", shell_complete=_complete_fault)
@click.argument("values", metavar="[KEY=VALUE]...", nargs=-1)
@client_options
def inject(fault: str, values: Sequence[str], timeout_s: float) -> None:
    """Inject a fault into the running simulation.

    For example: robotd sim inject amp_alarm axis=2 at_s=1.5.
    """
    fields = _fields(values)
    if fault not in FAULTS:
        raise click.BadParameter(f"{fault!r} is none of {', '.join(FAULTS)}")
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        parameter = import_ros("rclpy.parameter").Parameter
        settings = [parameter(key, value=value).to_parameter_msg() for key, value in fields.items()]
        service_type = import_ros("robotd_msgs.srv").InjectFault
        name = f"{SIMULATION_NODE}/inject"
        click.echo(client.call(service_type, name, kind=fault, settings=settings).message)


@sim.command("step", epilog=ROS_EPILOG)
@click.argument("periods", type=IntegerRange(1, MAX_STEPS), default=1)
@asks_robot
def step(client: RosClient, periods: int) -> object:
    """Run PERIODS control periods in the running simulation, then pause its time."""
    client.timeout_s += STEP_TIMEOUT_S
    service_type = import_ros("robotd_msgs.srv").StepTime
    return client.call(service_type, f"{SIMULATION_NODE}/step", periods=periods).message


@sim.command("pause", epilog=ROS_EPILOG)
@asks_robot
def pause(client: RosClient) -> object:
    """Pause the time of the running simulation."""
    return client.switch(f"{SIMULATION_NODE}/pause", True)


@sim.command("resume", epilog=ROS_EPILOG)
@asks_robot
def resume(client: RosClient) -> object:
    """Resume the time of the running simulation."""
    return client.switch(f"{SIMULATION_NODE}/pause", False)


@sim.command("place", epilog=ROS_EPILOG)
@click.argument("name")
@click.argument("values", metavar="KEY=VALUE...", nargs=-1, required=True)
@client_options
def place(name: str, values: Sequence[str], timeout_s: float) -> None:
    """Move an object of the simulated world, such as: robotd sim place cube x=0.4 y=0.1.

    Keys are x, y, z in m and roll, pitch, yaw in rad. Coordinates that are not given stay; of an
    orientation those angles are 0. The backend needs a world, as mujoco has one.
    """
    fields = _fields(values)
    for key, value in fields.items():
        if key not in (*COORDINATES, *ANGLES):
            raise click.BadParameter(f"{key} is none of {', '.join((*COORDINATES, *ANGLES))}")
        if isinstance(value, bool | str) or not math.isfinite(value):
            raise click.BadParameter(f"{key}: {value!r} is not a number")
    position = [float(fields.get(key, math.nan)) for key in COORDINATES]
    is_turned = not fields.keys().isdisjoint(ANGLES)
    rpy = [float(fields.get(key, 0.0)) for key in ANGLES] if is_turned else []
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        service_type = import_ros("robotd_msgs.srv").PlaceObject
        request = {"name": name, "position": position, "rpy": rpy}
        click.echo(client.call(service_type, f"{WORLD_NODE}/place", **request).message)


@sim.command("reset", epilog=ROS_EPILOG)
@asks_robot
def reset(client: RosClient) -> object:
    """Put the objects of the simulated world back to where they were at the start."""
    return client.trigger(f"{WORLD_NODE}/reset")


def run_scenario(file: Path, robot: str | None, scale: float | None) -> ExitCode:
    """Run it, print each step, and return the exit status."""
    scenario = load_scenario(file)
    robot = robot or scenario.robot
    if robot is None:
        raise DescriptorError("names no robot, and none is given by --robot", path=file)
    if not scenario.program:
        raise DescriptorError("has no program: there is nothing to run", path=file)
    descriptor = load_robot(robot, scenario.variant)
    backend = load_backend(scenario.backend)
    run = ScenarioRun(scenario, descriptor, backend, math.inf if scale is None else scale)
    for done in run.steps():
        mark = click.style("ok  ", fg="green") if done.failure is None else _failed()
        click.echo(f"{done.time_s:9.3f} s  {mark}  {done.step}")
    _tell(run.result)
    return ExitCode.FAILED if run.result.failures else ExitCode.OK


def _fields(words: Sequence[str]) -> dict[str, Any]:
    """Return the values by their keys, each of which is given once."""
    fields: dict[str, Any] = {}
    for word in words:
        key, value = _value(word)
        if key in fields:
            raise click.BadParameter(f"{key} is given twice")
        fields[key] = value
    return fields


def _value(word: str) -> tuple[str, Any]:
    """Parse ``key=value`` with the value as a bool, an int, a float or text."""
    key, _, text = word.partition("=")
    if not (key and text):
        raise click.BadParameter(f"{word!r} is not like axis=2")
    if text in ("true", "false"):
        return key, text == "true"
    for parse in (parse_integer, parse_number):
        with suppress(ValueError):
            return key, parse(text)
    with suppress(ValueError):
        parse_number(text.replace("_", ""))
        raise click.BadParameter(f"{key}: {text!r} is not a number")
    return key, text


def _failed() -> str:
    return click.style("FAIL", fg="red", bold=True)


def _tell(result: Result) -> None:
    for fault in result.faults:
        what = "over: " if fault.over else ""
        click.echo(f"{fault.time_s:9.3f} s  fault  {what}{fault.fault}")
    for failure in result.failures:
        click.echo(f"{_failed()}  {failure}")
    speed = result.simulated_s / result.real_s if result.real_s > 0 else math.nan
    click.echo(
        f"{result.simulated_s:.3f} s simulated in {result.real_s:.3f} s ({speed:.1f} times real"
        f" time), {result.periods} periods, joint states {result.digest[:16]}"
    )
    if not result.failures:
        click.echo("passed")
