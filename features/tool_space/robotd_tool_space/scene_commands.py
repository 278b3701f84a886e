"""``robotd scene``."""

from __future__ import annotations

from typing import Any

import click

from robotd.api.commands import ExitCode, import_ros
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    client_options,
    require_one_robot,
    robot_client,
)
from robotd_tool_space.commands import DEG, GROUP

DECIMALS = 4  # of a pose
SIZES = {"box": ("X", "Y", "Z"), "cylinder": ("RADIUS", "LENGTH"), "sphere": ("RADIUS",)}


@click.group("scene", epilog=ROS_EPILOG)
def scene() -> None:
    """List and change what an arm keeps away from.

    The robot's file has to ask for checks of collisions (`tool_space.collisions`). What is added
    here is forgotten when the robot ends. No safety function.
    """


@scene.command("list", epilog=ROS_EPILOG)
@client_options
def list_objects(timeout_s: float) -> ExitCode:
    """List the objects: shape, size in m, and where they are."""
    clients = import_ros("robotd_ros.client.tool_client")
    moves = import_ros("robotd_ros.commands.tool_move")
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        objects = clients.scene_objects(client)
    if not objects:
        click.echo("the scene is empty")
        return ExitCode.OK
    several = len({item.group for item in objects}) > 1
    for item in objects:
        size = " x ".join(f"{size:g}" for size in item.size_m)
        place = " ".join(
            f"{name}={rounded:g}"
            for name, value in moves.components_of(item.pose).items()
            if (rounded := round(value, DECIMALS))
        )
        where = f"{'on the tool ' if item.attached else ''}{place or 'x=0'}"
        marks = [item.group] if several else []
        marks += ["of the robot's file"] if item.in_file else []
        notes = f"  ({', '.join(marks)})" if marks else ""
        click.echo(f"{item.name:<15} {item.shape:<9} {size:<17} {where}{notes}")
    return ExitCode.OK


@scene.command("add", epilog=ROS_EPILOG)
@click.argument("name")
@click.argument("shape", type=click.Choice([*SIZES, "plane"]))
@click.argument("words", metavar="[SIZE...] [COMPONENT=VALUE...]", nargs=-1)
@click.option("--attached", is_flag=True, help="The tool carries it: the pose is in its link.")
@GROUP
@DEG
@client_options
def add(timeout_s: float, *, words: tuple[str, ...], deg: bool, **given: Any) -> ExitCode:
    """Add an object, or replace the one of that name.

    For example: robotd scene add crate box 0.4 0.3 0.2 x=0.5 z=0.1 yaw=0.3. Sizes are in m: three
    edges of a box, radius and length of a cylinder along its z, the radius of a sphere; a plane has
    none, and its z points to where the arm may be. The pose is that of the middle in the base of
    the arm.
    """
    moves = import_ros("robotd_ros.commands.tool_move")
    sizes = [word for word in words if "=" not in word]
    pose = _pose(moves, [word for word in words if "=" in word], deg=deg)
    names = SIZES.get(given["shape"], ())
    if len(sizes) != len(names):
        needed = " ".join(names) or "no size"
        raise click.BadParameter(f"a {given['shape']} needs {needed}, not {' '.join(sizes)!r}")
    size_m = [_length(size) for size in sizes]
    return _change(timeout_s, "add", pose=pose, size_m=size_m, **given)


@scene.command("move", epilog=ROS_EPILOG)
@click.argument("name")
@click.argument("words", metavar="COMPONENT=VALUE...", nargs=-1, required=True)
@GROUP
@DEG
@client_options
def move(timeout_s: float, *, words: tuple[str, ...], deg: bool, **given: Any) -> ExitCode:
    """Move an object to another pose, in the frame that its pose is in."""
    moves = import_ros("robotd_ros.commands.tool_move")
    return _change(timeout_s, "move", pose=_pose(moves, words, deg=deg), **given)


@scene.command("remove", epilog=ROS_EPILOG)
@click.argument("name", required=False)
@click.option("--all", "everything", is_flag=True, help="All that are not of the robot's file.")
@GROUP
@client_options
def remove(timeout_s: float, *, name: str | None, everything: bool, group: str) -> ExitCode:
    """Remove an object."""
    if bool(name) == everything:
        raise click.UsageError("give the NAME of an object, or --all")
    return _change(timeout_s, "remove", name=name or "", group=group)


@scene.command("attach", epilog=ROS_EPILOG)
@click.argument("name")
@GROUP
@client_options
def attach(timeout_s: float, **given: Any) -> ExitCode:
    """Let the tool carry an object from where it is, as after a grasp."""
    return _change(timeout_s, "attach", **given)


@scene.command("detach", epilog=ROS_EPILOG)
@click.argument("name")
@GROUP
@client_options
def detach(timeout_s: float, **given: Any) -> ExitCode:
    """Leave an object that the tool carries where it is."""
    return _change(timeout_s, "detach", **given)


def _length(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise click.BadParameter(f"{text!r} is not a length in m") from None


def _pose(moves: Any, words: Any, *, deg: bool) -> Any:
    components, relative = moves.parse_components(words, deg=deg)
    if relative:
        raise click.BadParameter("a pose has words like x=0.3")
    return moves.pose_message({**dict.fromkeys(moves.COMPONENTS, 0.0), **components})


def _change(timeout_s: float, operation: str, **fields: Any) -> ExitCode:
    clients = import_ros("robotd_ros.client.tool_client")
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        click.echo(clients.change_scene(client, operation, **fields))
    return ExitCode.OK
