"""``robotd snapshot``: save the last seconds of a running robot."""

from __future__ import annotations

from collections.abc import Sequence

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.group import ros_args
from robotd.cli.options import configure_logging
from robotd.cli.preflight import import_ros
from robotd.cli.robot_client import ROS_EPILOG, client_options, robot_client

SAVE_TIMEOUT_S = 30.0  # the file is written before the answer


@click.command("snapshot", epilog=ROS_EPILOG)
@client_options
@click.pass_context
def snapshot(ctx: click.Context, /, *, timeout_s: float) -> None:
    """Save the last seconds of the running robot.

    The flight recorder writes them to a file on the robot's computer, whose path is printed.
    """
    configure_logging(ctx)
    ctx.exit(_snapshot(ros_args(ctx), timeout_s))


def _snapshot(ros_args: Sequence[str], timeout_s: float) -> ExitCode:
    with robot_client(ros_args, max(timeout_s, SAVE_TIMEOUT_S)) as client:
        click.echo(import_ros("client.status_client").save_snapshot(client))
    return ExitCode.OK
