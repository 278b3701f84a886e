"""``robotd path``: record how the arm is moved by a name, and play it."""

from __future__ import annotations

import json
from bisect import bisect_right
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import click

from robotd.api.commands import (
    ExitCode,
    Interrupt,
    NumberRange,
    columns,
    escaped,
    import_ros,
)
from robotd_ros.commands.goal import ProgressLine, exit_code, print_ending
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    client_options,
    require_one_robot,
    robot_client,
)
from robotd_teach.path_exchange_command import export_path, import_path
from robotd_teach.status_line import StatusLine

CLIENT = "robotd_teach.path_client"


@click.group("path")
def path() -> None:
    """Record how the joints of the running robot are moved, and play it."""


path.add_command(import_path)
path.add_command(export_path)


@path.command("record", epilog=ROS_EPILOG)
@click.argument("name")
@click.option("--group", default="", metavar="NAME", help="Joint group, where there are several.")
@click.option("--replace", is_flag=True, help="Replace a path of this name.")
@client_options
def record(timeout_s: float, *, name: str, group: str, replace: bool) -> None:
    """Record the joints until Ctrl-C, whatever moves them, and save the path.

    Move the arm meanwhile, by 'robotd guide', the page or any command. Standing still at both ends
    is left out. Where this command is lost the recording goes on: 'robotd path end' saves it.
    """
    record_path = import_ros(CLIENT).record
    values = {"name": name, "group": group, "replace": replace}
    show = _Recording()
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        with Interrupt() as interrupt:
            try:
                text = record_path(client, values, lambda: interrupt.happened or show.ended, show)
            finally:
                show.end()
    with suppress(OSError):  # of a lost terminal
        click.echo(escaped(text))


@path.command("end", epilog=ROS_EPILOG)
@client_options
def end(timeout_s: float) -> None:
    """End the recording under way and save its path, as Ctrl-C in 'record' does."""
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        click.echo(import_ros(CLIENT).end(client))


@path.command("list", epilog=ROS_EPILOG)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@client_options
def list_paths(timeout_s: float, *, as_json: bool) -> None:
    """List the paths, and what is wrong with one."""
    paths_of = import_ros(CLIENT).paths_of
    with robot_client(timeout_s) as client:
        require_one_robot(client, prints=False)
        found = paths_of(client)
    if as_json:
        click.echo(json.dumps(found, indent=2))
        return
    if not found:
        click.echo("no paths: robotd path record NAME records how the joints are moved")
    rows = [
        [name, f"{told['duration_s']:.1f} s", f"{told['points']} points", ", ".join(told["joints"])]
        for name, told in found.items()
    ]
    for line in columns(rows):
        click.echo(escaped(line))
    for name, told in found.items():
        if told["problem"]:
            click.echo(escaped(f"{name} cannot be played: {told['problem']}"))


def _playback(command: Any) -> Any:
    """Add the options of how a path is played."""
    options = (
        click.option(
            "--speed",
            type=NumberRange(0.01, 1.0),
            help="Part of the recorded speed, by default 1, or of the limits, by default 0.2.",
        ),
        click.option(
            "--timing",
            type=click.Choice(["recorded", "limits"]),
            default="recorded",
            show_default=True,
            help="What --speed is a part of: limits of velocity and acceleration of the joints.",
        ),
        click.option("--reverse", is_flag=True, help="From its end to its start."),
        click.option(
            "--from",
            "begin",
            type=NumberRange(0.0, 0.999),
            default=0.0,
            help="Part of its time that is left out first.",
        ),
    )
    for option in reversed(options):
        command = option(command)
    return command


@path.command("show", epilog=ROS_EPILOG)
@click.argument("name")
@_playback
@client_options
def show_path(timeout_s: float, *, name: str, **playback: Any) -> None:
    """Show how a path would be played from where the arm is. Nothing moves."""
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        plan = import_ros(CLIENT).plan(client, name, approach=True, **playback)
    click.echo(plan.message)
    points = plan.trajectory.points
    ends = points[plan.parts.count(plan.parts[0]) - 1].positions, points[-1].positions
    rows = [
        [joint, *(f"{end[index]:+z.3f}" for end in ends)]
        for index, joint in enumerate(plan.trajectory.joint_names)
    ]
    for line in columns([["joint", "begin", "end"], *rows]):
        click.echo(line)


@path.command("play", epilog=ROS_EPILOG)
@click.argument("name")
@_playback
@click.option(
    "--approach", is_flag=True, help="Go to where it begins first, at a fifth of the limits."
)
@client_options
def play(timeout_s: float, *, name: str, approach: bool, **playback: Any) -> ExitCode:
    """Move along a path, by default as it was recorded.

    The arm has to be where it begins, or is brought there by --approach. Ctrl-C, or the loss of the
    terminal, stops it on the path and waits until it is at rest.
    """
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        plan = import_ros(CLIENT).plan(client, name, approach=approach, **playback)
        click.echo(plan.message)
        motion = import_ros("robotd_ros.client.motion_client")
        arm = motion.find_arm(client, plan.trajectory.joint_names)
        import_ros("robotd_ros.client.operator_client").require_motion(client, arm.namespace)
        progress = _Progress(name, plan, playback["reverse"])
        with Interrupt() as interrupt:
            ending, reason = motion.follow(
                client, arm, plan.trajectory, lambda: interrupt.happened, progress.show
            )
        progress.end()
    if ending.value != "reached" and progress.passed_s:
        with suppress(OSError):  # of a lost terminal
            click.echo(progress.remaining)
    return print_ending(exit_code(ending, reason), reason)


@path.command("rename", epilog=ROS_EPILOG)
@click.argument("name")
@click.argument("new")
@client_options
def rename(timeout_s: float, *, name: str, new: str) -> None:
    """Give a path another name."""
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        click.echo(import_ros(CLIENT).rename(client, name, new))


@path.command("delete", epilog=ROS_EPILOG)
@click.argument("name")
@client_options
def delete(timeout_s: float, *, name: str) -> None:
    """Delete a path."""
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        click.echo(import_ros(CLIENT).delete(client, name))


class _Recording(StatusLine):
    """Says that a recording has begun, and shows the joints on a line of a terminal."""

    ended = _begun = False

    def __call__(self, state: Any) -> None:
        if not self._begun:
            self._begun = True
            self.keep(f"{', '.join(state.joints)} are recorded; move them, Ctrl-C ends it")
        positions = " ".join(f"{position:+z.3f}" for position in state.positions)
        self.replace(f"{state.duration_s:.1f} s  {positions}")
        if state.reason:
            self.ended = True
            self.keep(f"the recording has ended: {state.reason}")


class _Progress(ProgressLine):
    """Shows how far a path was played."""

    def __init__(self, name: str, plan: Any, is_reverse: bool) -> None:
        seconds = import_ros("robotd_ros.trajectory_messages").duration_s
        self._times_s = [seconds(point.time_from_start) for point in plan.trajectory.points]
        super().__init__(plan.trajectory.joint_names, self._times_s[-1])
        self._name, self._parts = name, plan.parts
        self._options = "--reverse " if is_reverse else ""
        self.passed_s = 0.0

    def show(self, passed_s: float, positions: Mapping[str, float]) -> None:
        self.passed_s = passed_s
        super().show(passed_s, positions)

    @property
    def remaining(self) -> str:
        """Text about where a path that was ended early goes on."""
        passed = bisect_right(self._times_s, self.passed_s) - 1
        part = self._parts[passed]
        options = f"{self._options}--from {part:.3f} --approach"
        return (
            f"ended at {part:.3f} of {self._name}; robotd path play {self._name} {options} goes on"
        )
