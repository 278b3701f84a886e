"""``robotd output``: set a named output of a running robot."""

from __future__ import annotations

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.group import ros_args
from robotd.cli.options import configure_logging
from robotd.cli.preflight import import_ros
from robotd.cli.robot_client import ROS_EPILOG, client_options, robot_client


@click.command("output", epilog=ROS_EPILOG)
@click.argument("name")
@click.argument("level", type=click.Choice(["on", "off"]))
@client_options
@click.pass_context
def output(ctx: click.Context, /, name: str, level: str, timeout_s: float) -> None:
    """Set an output of the running robot by its name in the descriptor."""
    configure_logging(ctx)
    with robot_client(ros_args(ctx), timeout_s) as client:
        click.echo(import_ros("client.io_client").set_output(client, name, level == "on"))
    ctx.exit(ExitCode.OK)
