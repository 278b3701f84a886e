"""``robotd jog``: move one joint of a running arm by an increment."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import click

from robotd.cli.exit_codes import ExitCode, Rejected
from robotd.cli.group import ros_args
from robotd.cli.interrupt import Interrupt
from robotd.cli.options import configure_logging, not_nan
from robotd.cli.preflight import import_ros
from robotd.cli.robot_client import ROS_EPILOG, client_options, robot_client
from robotd.errors import unknown_name

MIN_TIME_S = 0.3
PEAK = 2.0  # upper bound of the peak velocity of a motion over its mean velocity


def finite(ctx: click.Context, param: click.Parameter, value: float) -> float:
    """Reject an increment that is not finite."""
    if not math.isfinite(value):
        raise click.BadParameter(f"{value} is not a finite number")
    return value


@click.command(
    "jog", epilog=ROS_EPILOG, context_settings={"ignore_unknown_options": True}
)  # an increment may begin with a minus
@click.argument("joint")
@click.argument("increment", metavar="±INCREMENT", type=float, callback=finite)
@click.option("--deg", is_flag=True, help="Increment and speed are in degrees, not radians.")
@click.option(
    "--speed",
    metavar="SPEED",
    type=click.FloatRange(0.0, min_open=True),
    callback=not_nan,
    help="Highest speed on the way; 0.1 rad/s or m/s by default.",
)
@click.option("--action", metavar="NAME", help="The arm's action, where several arms run.")
@client_options
@click.pass_context
def jog(ctx: click.Context, /, **options: Any) -> None:
    """Move one joint of the running arm by an increment.

    For example: robotd jog joint2 +0.01. The other joints stay where they are. Ctrl-C stops.
    """
    configure_logging(ctx)
    ctx.exit(_jog(ros_args(ctx), **options))


def _jog(
    ros_args: Sequence[str],
    timeout_s: float,
    *,
    joint: str,
    increment: float,
    deg: bool,
    speed: float | None,
    action: str | None,
) -> ExitCode:
    """Move ``joint``; INTERRUPTED after Ctrl-C. Raises Rejected with the robot's reason."""
    unit = math.radians(1.0) if deg else 1.0
    distance, fastest = increment * unit, 0.1 if speed is None else speed * unit
    time_s = max(PEAK * abs(distance) / fastest, MIN_TIME_S)
    with robot_client(ros_args, timeout_s, searches=True) as client:
        motion = import_ros("client.motion_client")
        with import_ros("client.status_client").reason_of_silence(client):
            arm = motion.find_arm(client, action)
        if joint not in arm.positions:
            raise click.BadParameter(unknown_name("joint", joint, arm.positions))
        target = arm.positions[joint] + distance
        with Interrupt() as interrupt:
            ending, reason = motion.move(
                client, arm, {joint: target}, time_s, lambda: interrupt.happened, _no_progress
            )
    if ending is motion.Ending.ABORTED:
        raise Rejected(reason)
    click.echo(f"{joint}: {target / unit:+.4f} {'°' if deg else 'rad or m'}; {reason}")
    return ExitCode.INTERRUPTED if ending is motion.Ending.CANCELED else ExitCode.OK


def _no_progress(time_s: float, positions: object) -> None:
    """Show nothing: an increment is short."""
