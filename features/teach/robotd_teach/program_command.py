"""``robotd program``: check and run programs of steps."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robotd.api.commands import FILE, ExitCode, Interrupt, escaped, import_ros
from robotd_ros.commands.goal import bar, exit_code, print_ending
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    client_options,
    require_one_robot,
    robot_client,
)
from robotd_teach.status_line import StatusLine

if TYPE_CHECKING:  # it needs rclpy
    from robotd_ros.client.ros_client import RosClient

SERVICES = "robotd/program"
CHECK_TIMEOUT_S = 60.0  # of the longest program, on a slow computer
ACTIVE = ("running", "paused", "waiting")


@click.group("program")
def program() -> None:
    """Check and run programs of steps on the running robot."""


@program.command("check", epilog=ROS_EPILOG)
@click.argument("file", type=FILE)
@client_options
def check(timeout_s: float, *, file: Path) -> None:
    """Check a whole program from where the arm is. Nothing moves."""
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        client.timeout_s = max(client.timeout_s, CHECK_TIMEOUT_S)
        click.echo(import_ros("robotd_teach.program_client").check(client, **_content(file)))


@program.command("run", epilog=ROS_EPILOG)
@click.argument("file", type=FILE)
@client_options
def run(timeout_s: float, *, file: Path) -> ExitCode:
    """Check a program and run it from its first step.

    Ctrl-C, or the loss of the terminal, stops it on its path and waits until the arm is at rest.
    """
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        return _execute(client, "run", **_content(file))


@program.command("step", epilog=ROS_EPILOG)
@click.argument("file", type=FILE)
@client_options
def step(timeout_s: float, *, file: Path) -> ExitCode:
    """Execute one step: the next one of the program that was stopped, if it is this one.

    Of another program it is the first.
    """
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        return _execute(client, "step", **_content(file))


@program.command("resume", epilog=ROS_EPILOG)
@client_options
def resume(timeout_s: float) -> ExitCode:
    """Continue the program where it was stopped, paused, or waits for the operator.

    A motion continues on its path. The arm has to be where it was left.
    """
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        state = import_ros("robotd_teach.program_client").program_state(client)
        if state["state"] in ACTIVE:
            click.echo(client.trigger(f"{SERVICES}/proceed"))
            return ExitCode.OK
        return _execute(client, "resume")


@program.command("pause", epilog=ROS_EPILOG)
@client_options
def pause(timeout_s: float) -> None:
    """Pause all motion on its path, and so the program that runs."""
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        click.echo(client.trigger(f"{SERVICES}/pause"))


@program.command("stop", epilog=ROS_EPILOG)
@client_options
def stop(timeout_s: float) -> None:
    """Stop the program that runs, on its path. 'robotd stop' stops all motion."""
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        click.echo(client.trigger(f"{SERVICES}/stop"))


@program.command("status", epilog=ROS_EPILOG)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@client_options
def status(timeout_s: float, *, as_json: bool) -> None:
    """Show the program that runs or ran last, and its step."""
    with robot_client(timeout_s) as client:
        require_one_robot(client, prints=False)
        state = import_ros("robotd_teach.program_client").program_state(client)
    if as_json:
        click.echo(json.dumps(state, indent=2))
        return
    if state["state"] == "none":
        click.echo("no program was run since robotd was started")
        return
    click.echo(escaped(f"{state['file']}: {state['state']}"))
    where = f"{state['step']} of {state['steps']}"
    where += f", line {state['line']}: {state['text']}" if state["step"] else ": not begun"
    for name, text in (("step", where), ("message", state["message"]), ("why", state["reason"])):
        if text:
            click.echo(escaped(f"  {name:<9} {text}"))


def _content(file: Path) -> dict[str, Any]:
    return {"file": str(file), "text": file.read_text(encoding="utf-8")}


def _execute(client: RosClient, mode: str, **content: Any) -> ExitCode:
    """Send a goal and show its steps until it has ended."""
    client.timeout_s = max(client.timeout_s, CHECK_TIMEOUT_S)
    show = _Steps()
    with Interrupt() as interrupt:
        ending, text = import_ros("robotd_teach.program_client").execute(
            client, mode, lambda: interrupt.happened, show, **content
        )
    show.end()
    return print_ending(exit_code(ending, text), text)


class _Steps(StatusLine):
    """Shows each step on a line of standard error, and the progress of its motion on a terminal."""

    def __init__(self) -> None:
        super().__init__()
        self._executed: tuple[int, int] | None = None

    def __call__(self, feedback: Any) -> None:
        here = feedback.executed, feedback.step
        if feedback.step and here != self._executed:
            self._executed = here
            self.keep(f"step {feedback.step} of {feedback.steps}: {feedback.text}")
        what = "" if feedback.state == "running" else f"  {feedback.state}"
        self.replace(f"{bar(feedback.progress)}{what}")
