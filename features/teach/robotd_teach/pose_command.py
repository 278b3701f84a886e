"""``robotd pose``: save where the arm is by a name, and go there."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import click

from robotd.api.commands import ExitCode, NumberRange, columns, escaped, import_ros
from robotd_ros.commands.goal import ProgressLine, carry_out, print_ending
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    client_options,
    require_one_robot,
    robot_client,
)
from robotd_ros.commands.tool_move import COMPONENTS, move_tool_to

CLIENT = "robotd_teach.pose_client"
SPEED = 0.2


@click.group("pose")
def pose() -> None:
    """Save where the joints of the running robot are by a name, and go there."""


@pose.command("save", epilog=ROS_EPILOG)
@click.argument("name")
@click.option("--group", default="", metavar="NAME", help="Joint group, where there are several.")
@click.option("--replace", is_flag=True, help="Replace a pose of this name.")
@client_options
def save(timeout_s: float, *, name: str, group: str, replace: bool) -> None:
    """Save where the joints are. Nothing moves; servos may be off."""
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        text = import_ros(CLIENT).save(client, name, group, replace=replace)
        click.echo(f"{name}: {text}")


@pose.command("list", epilog=ROS_EPILOG)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@client_options
def list_poses(timeout_s: float, *, as_json: bool) -> None:
    """List the poses, and what is wrong with one."""
    poses_of = import_ros(CLIENT).poses_of
    with robot_client(timeout_s) as client:
        require_one_robot(client, prints=False)
        found = poses_of(client)
    if as_json:
        click.echo(json.dumps(found, indent=2))
        return
    if not found:
        click.echo("no poses: robotd pose save NAME saves where the joints are")
    rows = [
        [name, *(f"{joint} {value:+z.3f}" for joint, value in told["joints"].items())]
        for name, told in found.items()
    ]
    longest = max(map(len, rows), default=0)
    for line in columns(row + [""] * (longest - len(row)) for row in rows):
        click.echo(line)
    for name, told in found.items():
        if told["tool"]:
            click.echo(escaped(f"{name}: {_tool_text(told['tool'])}"))
    for name, told in found.items():
        if told["problem"]:
            click.echo(escaped(f"{name} cannot be gone to: {told['problem']}"))


@pose.command("go", epilog=ROS_EPILOG)
@click.argument("name")
@click.option(
    "--speed",
    type=NumberRange(0.01, 1.0),
    default=SPEED,
    show_default=True,
    help="Part of the velocity and acceleration limits of the joints, or of the tool's speed.",
)
@click.option("--line", is_flag=True, help="Along a straight line of the chosen tool.")
@click.option("--group", default="", metavar="NAME", help="With --line, of several joint groups.")
@client_options
def go(timeout_s: float, *, name: str, speed: float, line: bool, group: str) -> ExitCode:
    """Move to a pose, by default slowly.

    All joints of the pose move together and arrive together. Ctrl-C, or the loss of the terminal,
    stops the motion and waits until the arm is at rest.
    """
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        joints, seconds = import_ros(CLIENT).plan(client, name, speed)
        if line:
            import_ros("robotd_ros.client.operator_client").require_motion(client)
            pose = import_ros(CLIENT).tool_pose_at(client, joints, group)
            code, reason = move_tool_to(client, pose, line=True, speed=speed, group=group)
            return print_ending(code, reason)
        arm = import_ros("robotd_ros.client.motion_client").find_arm(client, joints)
        import_ros("robotd_ros.client.operator_client").require_motion(client, arm.namespace)
        progress = ProgressLine(tuple(joints), seconds)
        code, reason = carry_out(client, arm, joints, seconds, progress.show)
        progress.end()
    return print_ending(code, reason)


def _tool_text(tool: Mapping[str, Any]) -> str:
    """Return the pose of a tool as text."""
    place = "  ".join(f"{part} {tool[part]:+z.3f}" for part in COMPONENTS)
    return f"{tool['tool'] or 'link'} in {tool['work_frame'] or 'base'} at {place}"


@pose.command("rename", epilog=ROS_EPILOG)
@click.argument("name")
@click.argument("new")
@client_options
def rename(timeout_s: float, *, name: str, new: str) -> None:
    """Give a pose another name."""
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        click.echo(import_ros(CLIENT).rename(client, name, new))


@pose.command("delete", epilog=ROS_EPILOG)
@click.argument("name")
@client_options
def delete(timeout_s: float, *, name: str) -> None:
    """Delete a pose."""
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        click.echo(import_ros(CLIENT).delete(client, name))
