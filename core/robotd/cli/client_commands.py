"""The commands for a robot that is running already. What they do is in ``client.py``."""

from __future__ import annotations

import math
from typing import Any

import click

from robotd.cli.group import ros_args
from robotd.cli.options import Command, as_json, configure_logging, log_options, not_nan

ROS_EPILOG = "What follows --ros-args goes to ROS; give the same remaps as to the robot."


def parse_targets(
    ctx: click.Context, param: click.Parameter, words: tuple[str, ...]
) -> dict[str, float]:
    """``joint1=0.5 joint3=-0.4`` → positions by joint."""
    targets: dict[str, float] = {}
    for word in words:
        joint, _, text = word.partition("=")
        if not (joint and text):
            raise click.BadParameter(f"{word!r} is not like joint1=0.5")
        try:
            position = float(text)
        except ValueError:
            position = math.nan
        if not math.isfinite(position):
            raise click.BadParameter(f"{joint}: {text!r} is not a number")
        if joint in targets:
            raise click.BadParameter(f"{joint} is given twice")
        targets[joint] = position
    return targets


def client_options(command: Command) -> Command:
    """How long to wait, and the options of every command."""
    timeout = click.option(
        "--timeout",
        "timeout_s",
        metavar="SECONDS",
        type=click.FloatRange(0.1, 600),
        callback=not_nan,
        default=5.0,
        show_default=True,
        help="How long the robot may take to answer.",
    )
    return timeout(log_options(command))


@click.command("move", epilog=ROS_EPILOG)
@click.argument(
    "targets", metavar="JOINT=POSITION...", nargs=-1, required=True, callback=parse_targets
)
@click.option(
    "--time",
    "time_s",
    metavar="SECONDS",
    type=click.FloatRange(0.01, 3600),
    callback=not_nan,
    default=2.0,
    show_default=True,
    help="Duration of the motion.",
)
@click.option("--deg", is_flag=True, help="Positions are degrees, not radians.")
@click.option("--action", metavar="NAME", help="The arm's action, where several arms run.")
@client_options
@click.pass_context
def move(ctx: click.Context, /, **options: Any) -> None:
    """Move joints of the running arm.

    For example: robotd move joint1=0.5 joint3=-0.4. Joints that are not named stay where they are.
    Ctrl-C stops the motion and waits until the arm stands.
    """
    from robotd.cli import client

    configure_logging(ctx)
    ctx.exit(client.move(ros_args(ctx), **options))


@click.command("gripper", epilog=ROS_EPILOG)
@click.argument("command", type=click.Choice(["open", "close"]))
@client_options
@click.pass_context
def gripper(ctx: click.Context, /, command: str, timeout_s: float) -> None:
    """Open or close the gripper of the running robot."""
    from robotd.cli import client

    configure_logging(ctx)
    ctx.exit(client.gripper(ros_args(ctx), timeout_s, closed=command == "close"))


@click.command("servo", epilog=ROS_EPILOG)
@click.argument("command", type=click.Choice(["on", "off"]))
@click.argument("axes", metavar="[AXIS]...", type=click.IntRange(0, 127), nargs=-1)
@client_options
@click.pass_context
def servo(ctx: click.Context, /, command: str, axes: tuple[int, ...], timeout_s: float) -> None:
    """Switch the servos of the running robot.

    Those of all axes, or of the axes that are named. 'on' clears alarms first: it is the way back
    after a fault.
    """
    from robotd.cli import client

    configure_logging(ctx)
    ctx.exit(client.servo(ros_args(ctx), timeout_s, axes, on=command == "on"))


@click.command("status", epilog=ROS_EPILOG)
@as_json
@client_options
@click.pass_context
def status(ctx: click.Context, /, *, as_json: bool, timeout_s: float) -> None:
    """Show engine and axes of the running robot."""
    from robotd.cli import client

    configure_logging(ctx)
    ctx.exit(client.status(ros_args(ctx), timeout_s, as_json=as_json))


CLIENT_COMMANDS = (status, move, gripper, servo)
