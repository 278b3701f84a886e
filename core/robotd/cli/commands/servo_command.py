"""``robotd servo``: switch the servos of a running robot."""

from __future__ import annotations

from collections.abc import Sequence

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.group import ros_args
from robotd.cli.options import configure_logging
from robotd.cli.preflight import import_ros
from robotd.cli.robot_client import ROS_EPILOG, client_options, robot_client


@click.command("servo", epilog=ROS_EPILOG)
@click.argument("command", type=click.Choice(["on", "off"]))
@click.argument("axes", metavar="[AXIS]...", nargs=-1)
@client_options
@click.pass_context
def servo(ctx: click.Context, /, command: str, axes: tuple[str, ...], timeout_s: float) -> None:
    """Switch the servos of the running robot.

    Those of all axes, or of the axes that are given by name or by number from 0. 'on' clears
    alarms first: it is the way back after a fault.
    """
    configure_logging(ctx)
    ctx.exit(_servo(ros_args(ctx), timeout_s, axes, on=command == "on"))


def _servo(ros_args: Sequence[str], timeout_s: float, axes: Sequence[str], *, on: bool) -> ExitCode:
    """Switch servos, and print what each axis answers."""
    with robot_client(ros_args, timeout_s) as client:
        click.echo(import_ros("client.status_client").set_servos(client, axes, on))
    return ExitCode.OK
