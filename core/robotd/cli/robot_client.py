"""Options and connection of the commands that talk to a running robot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from robotd.cli.exit_codes import Rejected, RosUnavailable
from robotd.cli.options import Command, log_options, not_nan
from robotd.cli.preflight import import_ros
from robotd.errors import OperationError

if TYPE_CHECKING:  # it needs rclpy
    from robotd.ros.client.ros_client import RosClient

ROS_EPILOG = "What follows --ros-args goes to ROS; give the same remaps as to the robot."


def client_options(command: Command) -> Command:
    """Add the time-out of the robot's answer, and the options of every command."""
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


@contextmanager
def robot_client(
    ros_args: Sequence[str], timeout_s: float, *, searches: bool = False
) -> Iterator[RosClient]:
    """Open a client of the running robot.

    Raises RosUnavailable without ROS, Rejected with the robot's reason.
    """
    client = import_ros("client.ros_client").RosClient(ros_args, timeout_s, searches=searches)
    try:
        client.start()
    except OperationError as error:
        raise RosUnavailable(str(error)) from error
    try:
        yield client
    except OperationError as error:
        raise Rejected(str(error)) from error
    finally:
        client.close()
