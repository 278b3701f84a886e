"""Commands that ask one thing of a running robot, and print its answer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.preflight import import_ros
from robotd.number_argument import NumberRange
from robotd_ros.commands.robot_client import ROS_EPILOG, asks_robot
from robotd_ros.node_names import OPERATOR_NODE

if TYPE_CHECKING:  # it needs rclpy
    from robotd_ros.client.ros_client import RosClient

SAVE_TIMEOUT_S = 30.0  # the file is written before the answer


@click.command("gripper", epilog=ROS_EPILOG)
@click.argument("command", type=click.Choice(["open", "close", "home"]))
@asks_robot
def gripper(client: RosClient, command: str) -> object:
    """Open or close the gripper of the running robot, or home its fingers.

    home: the fingers move through their whole stroke, so that the device knows its ends.
    """
    status = import_ros("robotd_ros.client.status_client")
    if command == "home":
        return status.home_gripper(client)
    return status.set_gripper(client, command == "close")


@click.command("output", epilog=ROS_EPILOG)
@click.argument("name")
@click.argument("level", type=click.Choice(["on", "off"]))
@asks_robot
def output(client: RosClient, name: str, level: str) -> object:
    """Set an output of the running robot by its name in the descriptor."""
    return import_ros("robotd_ros.client.operator_client").set_output(client, name, level == "on")


@click.command("servo", epilog=ROS_EPILOG)
@click.argument("command", type=click.Choice(["on", "off"]))
@click.argument("axes", metavar="[AXIS]...", nargs=-1)
@asks_robot
def servo(client: RosClient, command: str, axes: Sequence[str]) -> object:
    """Switch the servos of the running robot.

    Those of all axes, or of the axes that are given by name or by number from 0. 'on' clears
    alarms first: it is the way back after a fault.
    """
    return import_ros("robotd_ros.client.status_client").set_servos(client, axes, command == "on")


@click.command("reset", epilog=ROS_EPILOG)
@asks_robot
def reset(client: RosClient) -> object:
    """Allow motion again after a stop. Nothing moves.

    A stop input has to allow motion before. Clients have to command motion anew.
    """
    return client.trigger(f"{OPERATOR_NODE}/reset")


def percentage(ctx: click.Context, argument: click.Parameter, percent: float) -> float:
    """Reject what is meant as a part of 1, such as 0.3."""
    if 0.0 < percent < 1.0:
        text = f"{percent:g} is in percent: give {100 * percent:g} for {100 * percent:g} %"
        raise click.BadParameter(f"{text}, and at least 1")
    return percent


@click.command("speed", epilog=ROS_EPILOG)
@click.argument("percent", type=NumberRange(0, 100), callback=percentage)
@asks_robot
def speed(client: RosClient, percent: float) -> object:
    """Set the speed of all motion of the running robot, 0 to 100 %.

    Goals keep their paths: velocities and accelerations scale, by ramps, also while they move. 0
    holds on the path. Moves, jogs and streams take the speed at their start.
    """
    return import_ros("robotd_ros.client.operator_client").set_speed(client, percent / 100.0)


@click.command("pause", epilog=ROS_EPILOG)
@asks_robot
def pause(client: RosClient) -> object:
    """Bring motion to rest on its path, to be resumed.

    Goals stay active; their clients may give up waiting. Streams end.
    """
    return client.trigger(f"{OPERATOR_NODE}/pause")


@click.command("resume", epilog=ROS_EPILOG)
@asks_robot
def resume(client: RosClient) -> object:
    """Resume motion after a pause."""
    return client.trigger(f"{OPERATOR_NODE}/resume")


@click.command("recover", epilog=ROS_EPILOG)
@asks_robot
def recover(client: RosClient) -> ExitCode:
    """Bring the running robot back after a fault. Nothing moves.

    Names the cause, then reconnects, clears alarms, switches the servos of joints and wheels on,
    and verifies that they take commands, as far as needed. Each step is printed as it happens.

    A stop stays in force until 'robotd reset': the status is 1 then, as after a failed step.
    """
    allowed = import_ros("robotd_ros.client.operator_client").recover(client, click.echo)
    return ExitCode.OK if allowed else ExitCode.FAILED


@click.command("snapshot", epilog=ROS_EPILOG)
@asks_robot
def snapshot(client: RosClient) -> object:
    """Save the last seconds of the running robot.

    The flight recorder writes them to a file on the robot's computer, whose path is printed.
    """
    client.timeout_s = max(client.timeout_s, SAVE_TIMEOUT_S)
    return client.trigger(f"{OPERATOR_NODE}/snapshot")
