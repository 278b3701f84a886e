"""``robotd recover``: bring a running robot back after a fault."""

from __future__ import annotations

from collections.abc import Sequence

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.group import ros_args
from robotd.cli.options import configure_logging
from robotd.cli.preflight import import_ros
from robotd.cli.robot_client import ROS_EPILOG, client_options, robot_client


@click.command("recover", epilog=ROS_EPILOG)
@client_options
@click.pass_context
def recover(ctx: click.Context, /, timeout_s: float) -> None:
    """Bring the running robot back after a fault. Nothing moves.

    Names the cause, then reconnects, clears alarms, switches the servos of joints and wheels on,
    and verifies that they take commands, as far as needed. Each step is printed as it happens.
    """
    configure_logging(ctx)
    ctx.exit(_recover(ros_args(ctx), timeout_s))


def _recover(ros_args: Sequence[str], timeout_s: float) -> ExitCode:
    """Recover, and print each step; raises Rejected for the step that failed."""
    with robot_client(ros_args, timeout_s) as client:
        import_ros("client.operator_client").recover(client, click.echo)
    return ExitCode.OK
