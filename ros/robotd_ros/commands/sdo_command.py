"""``robotd sdo``: read and write objects of the drives of a running robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from robotd.cli.preflight import import_ros
from robotd.number_argument import IntegerRange, ObjectNumber
from robotd_ros.commands.robot_client import ROS_EPILOG, asks_robot

if TYPE_CHECKING:  # it needs rclpy
    from robotd_ros.client.ros_client import RosClient

NUMBER = ObjectNumber(bits=32)  # fields of the requests

bus_option = click.option("--bus", type=NUMBER, default=0, show_default=True, help="Fieldbus.")


@click.group("sdo", epilog=ROS_EPILOG)
def sdo() -> None:
    """Read and write objects (SDO) of the running robot's drives."""


@sdo.command("read", epilog=ROS_EPILOG)
@click.argument("node", type=NUMBER)
@click.argument("index", type=NUMBER)
@click.argument("sub", type=NUMBER, default=0)
@bus_option
@asks_robot
def read(client: RosClient, node: int, index: int, sub: int, bus: int) -> object:
    """Print object INDEX:SUB of NODE: raw bytes, as a number, and as text."""
    return client.call(
        import_ros("robotd_msgs.srv").ReadObject,
        "wmx/ecat/read_object",
        bus=bus,
        node=node,
        index=index,
        subindex=sub,
    ).message


@sdo.command("write", epilog=ROS_EPILOG, context_settings={"ignore_unknown_options": True})
@click.argument("node", type=NUMBER)
@click.argument("index", type=NUMBER)
@click.argument("sub", type=NUMBER)
@click.argument("value", type=ObjectNumber(bits=64))
@click.option("--size", type=IntegerRange(1, 8), help="Bytes; by default as long as it reads.")
@bus_option
@asks_robot
def write(
    client: RosClient, node: int, index: int, sub: int, value: int, size: int | None, bus: int
) -> object:
    """Write VALUE to object INDEX:SUB of NODE, and print the value read back.

    All axes have to be at rest. The drive obeys, whatever the limits of the robot are.
    """
    return client.call(
        import_ros("robotd_msgs.srv").WriteObject,
        "wmx/ecat/write_object",
        bus=bus,
        node=node,
        index=index,
        subindex=sub,
        value=value,
        size=size or 0,
    ).message
