"""``robotd tool`` and ``robotd ik``."""

from __future__ import annotations

import math
from typing import Any

import click

from robotd.api.commands import FILE, ExitCode, IntegerRange, NumberRange, import_ros
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    client_options,
    require_one_robot,
    robot_client,
)

GROUP = click.option(
    "--group", default="", metavar="NAME", help="Joint group, where there are several."
)
DEG = click.option("--deg", is_flag=True, help="Angles are degrees, also those that are printed.")


@click.group("tool", invoke_without_command=True, epilog=ROS_EPILOG)
@GROUP
@DEG
@client_options
@click.pass_context
def tool(ctx: click.Context, timeout_s: float, *, group: str, deg: bool) -> ExitCode:
    """Show the pose of the tool, choose tool and work frame, or reduce its speed.

    `robotd move --tool` moves it.
    """
    ctx.obj = group
    if ctx.invoked_subcommand is not None:
        return ExitCode.OK
    moves = import_ros("robotd_ros.commands.tool_move")
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        pose, frame, name = import_ros("robotd_ros.client.tool_client").tool_pose(client, group)
    click.echo(f"{name} in {frame}:")
    for component, value in moves.components_of(pose).items():
        click.echo(f"  {component:<6}{_text(component, value, deg=deg)}")
    return ExitCode.OK


@tool.command("set", epilog=ROS_EPILOG)
@click.argument("name")
@client_options
@click.pass_obj
def set_tool(group: str, timeout_s: float, *, name: str) -> ExitCode:
    """Choose a tool by its name; none: the link itself."""
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        clients = import_ros("robotd_ros.client.tool_client")
        click.echo(clients.select_tool(client, "" if name == "none" else name, group))
    return ExitCode.OK


@tool.command("frame", epilog=ROS_EPILOG)
@click.argument("name")
@client_options
@click.pass_obj
def set_work_frame(group: str, timeout_s: float, *, name: str) -> ExitCode:
    """Choose a work frame by its name; none: the base of the arm.

    Of a frame in /tf, tf:NAME stays where that is now, and follow:NAME moves with it, for streams
    of the tool.
    """
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        clients = import_ros("robotd_ros.client.tool_client")
        click.echo(clients.select_work_frame(client, "" if name == "none" else name, group))
    return ExitCode.OK


@tool.command("reduced", epilog=ROS_EPILOG)
@click.argument("switch", type=click.Choice(["on", "off"]))
@client_options
def set_reduced_speed(timeout_s: float, *, switch: str) -> ExitCode:
    """Limit the speed of links and tool, or end that.

    To 0.25 m/s by default. No safety function. The input `reduced_speed_input` of the robot's file
    may keep it on.
    """
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        clients = import_ros("robotd_ros.client.tool_client")
        click.echo(clients.set_reduced_speed(client, on=switch == "on"))
    return ExitCode.OK


@tool.command("payload", epilog=ROS_EPILOG)
@click.argument("mass_kg", type=NumberRange(0.0, 1000.0), metavar="[KG]", required=False)
@click.option(
    "--center",
    "center_m",
    type=float,
    nargs=3,
    default=(0.0, 0.0, 0.0),
    metavar="X Y Z",
    help="Its centre of mass in the frame of the flange, m.",
)
@client_options
def payload(
    timeout_s: float, *, mass_kg: float | None, center_m: tuple[float, float, float]
) -> ExitCode:
    """Tell the arm what it carries: gripper, tool and part together; without KG show it.

    Nothing moves. It holds until robotd ends or another one is set.
    """
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        clients = import_ros("robotd_ros.client.operator_client")
        if mass_kg is None:
            click.echo(f"payload: {clients.payload_text(client)}")
        else:
            click.echo(f"payload: {clients.set_payload(client, mass_kg, center_m)}")
    return ExitCode.OK


@tool.command("calibrate", epilog=ROS_EPILOG)
@click.argument("name")
@click.option("--frame", "is_frame", is_flag=True, help="A work frame, by three points.")
@click.option(
    "--touches",
    type=IntegerRange(4, 20),
    default=4,
    show_default=True,
    help="Poses in which the tip of the tool touches its point.",
)
@click.option("--file", "path", type=FILE, metavar="FILE", help="Robot's file that gets it.")
@client_options
@click.pass_obj
def calibrate(group: str, /, timeout_s: float, *, is_frame: bool, **given: Any) -> None:
    """Find the tip of a tool by touching a point in four poses, or a frame by three points.

    Nothing moves by itself: jog the arm, or move it by hand, and press Enter at each touch. Turn
    the tool by 30° and more about different axes between two touches. A work frame is touched with
    the tip of the tool that is chosen. Without --file the frame is printed.
    """
    touched_frames = import_ros("robotd_tool_space.frames.touched_frames")
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        touched_frames.calibrate(client, group=group, is_frame=is_frame, **given)


@click.command("ik", epilog=ROS_EPILOG)
@click.argument("words", metavar="COMPONENT=VALUE...", nargs=-1, required=True)
@click.option("--all", "everything", is_flag=True, help="All solutions that are found.")
@GROUP
@DEG
@client_options
def ik(
    timeout_s: float, *, words: tuple[str, ...], everything: bool, group: str, deg: bool
) -> ExitCode:
    """Print joint positions for a pose of the tool; nothing moves.

    For example: robotd ik x=0.3 z=0.5 yaw=1.2. Components that are not named are the present ones.
    """
    moves = import_ros("robotd_ros.commands.tool_move")
    components, relative = moves.parse_components(words, deg=deg)
    if relative:
        raise click.BadParameter("a pose has words like x=0.3")
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        clients = import_ros("robotd_ros.client.tool_client")
        present = moves.components_of(clients.tool_pose(client, group)[0])
        pose = moves.pose_message({**present, **components})
        found = clients.joint_solutions(client, pose, group=group, everything=everything)
    for solution in found:
        click.echo(" ".join(f"{joint}={value:.6f}" for joint, value in solution.items()))
    return ExitCode.OK


def _text(component: str, value: Any, *, deg: bool) -> str:
    if component in ("x", "y", "z"):
        return f"{value:10.5f} m"
    return f"{math.degrees(value):10.3f}°" if deg else f"{value:10.5f} rad"
