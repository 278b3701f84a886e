"""``robotd gripper``: open or close the gripper of a running robot."""

from __future__ import annotations

from collections.abc import Sequence

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.group import ros_args
from robotd.cli.options import configure_logging
from robotd.cli.preflight import import_ros
from robotd.cli.robot_client import ROS_EPILOG, client_options, robot_client


@click.command("gripper", epilog=ROS_EPILOG)
@click.argument("command", type=click.Choice(["open", "close"]))
@client_options
@click.pass_context
def gripper(ctx: click.Context, /, command: str, timeout_s: float) -> None:
    """Open or close the gripper of the running robot."""
    configure_logging(ctx)
    ctx.exit(_gripper(ros_args(ctx), timeout_s, closed=command == "close"))


def _gripper(ros_args: Sequence[str], timeout_s: float, *, closed: bool) -> ExitCode:
    """Open or close it, and print the answer."""
    with robot_client(ros_args, timeout_s) as client:
        click.echo(import_ros("client.status_client").set_gripper(client, closed))
    return ExitCode.OK
