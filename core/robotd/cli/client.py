"""``robotd status | move | gripper | servo``: talk to a robot that another process serves."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from robotd.cli.exit_codes import ExitCode, Rejected, RosUnavailable
from robotd.cli.interrupt import Interrupt
from robotd.cli.layout import columns, field, warning
from robotd.cli.preflight import import_ros
from robotd.cli.progress import Progress
from robotd.errors import OperationError

if TYPE_CHECKING:  # they need rclpy
    from robotd.ros.client.ros_client import RosClient
    from robotd.ros.client.status_client import AxisReport


def status(ros_args: Sequence[str], timeout_s: float, *, as_json: bool) -> ExitCode:
    """Print the state; OK when the robot takes commands, else FAILED."""
    with _robot(ros_args, timeout_s) as client:
        report = import_ros("client.status_client").read_report(client)
    if as_json:
        click.echo(json.dumps(asdict(report), indent=2))
    else:
        ready = "ready" if report.ready else warning("not ready")
        click.echo(field("engine", [f"{report.state}, {ready}"]))
        if report.reason:
            click.echo(field("reason", [report.reason]))
        if report.remedy:
            click.echo(field("remedy", report.remedy.split(", then ")))
        lines = ["not published"] if report.axes is None else _table(report.axes)
        click.echo(field("axes", lines))
    return ExitCode.OK if report.ready else ExitCode.FAILED


def gripper(ros_args: Sequence[str], timeout_s: float, *, closed: bool) -> ExitCode:
    """Open or close it, and print the answer."""
    with _robot(ros_args, timeout_s) as client:
        click.echo(import_ros("client.status_client").set_gripper(client, closed))
    return ExitCode.OK


def servo(ros_args: Sequence[str], timeout_s: float, axes: Sequence[int], *, on: bool) -> ExitCode:
    """Switch servos, and print what each axis answers."""
    with _robot(ros_args, timeout_s) as client:
        click.echo(import_ros("client.status_client").set_servos(client, axes, on))
    return ExitCode.OK


def move(
    ros_args: Sequence[str],
    timeout_s: float,
    *,
    targets: Mapping[str, float],
    time_s: float,
    deg: bool,
    action: str | None,
) -> ExitCode:
    """Move joints to ``targets``, degrees where ``deg``; INTERRUPTED after Ctrl-C.

    Raises Refused, with the robot's reason, when the motion was refused or aborted.
    """
    radians = {joint: math.radians(value) if deg else value for joint, value in targets.items()}
    with _robot(ros_args, timeout_s, searches=True) as client:
        motion = import_ros("client.motion_client")
        import_ros("client.status_client").require_ready(client)
        arm = motion.find_arm(client, action)
        progress = Progress(tuple(targets), time_s, degrees=deg)
        with Interrupt() as interrupt:
            ending, reason = motion.move(
                client, arm, radians, time_s, lambda: interrupt.happened, progress.show
            )
        progress.end()
    if ending is motion.Ending.ABORTED:
        raise Rejected(reason)
    click.echo(reason)
    return ExitCode.INTERRUPTED if ending is motion.Ending.CANCELED else ExitCode.OK


@contextmanager
def _robot(
    ros_args: Sequence[str], timeout_s: float, *, searches: bool = False
) -> Iterator[RosClient]:
    """A client. Raises RosUnavailable without ROS, Refused for what the robot refuses."""
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


def _table(axes: Sequence[AxisReport]) -> list[str]:
    rows = [("axis", "servo", "alarm", "position", "velocity", "torque", "switches")]
    for axis in axes:
        switches = [
            name
            for name, active in (
                ("-limit", axis.negative_limit),
                ("+limit", axis.positive_limit),
                ("home", axis.home_switch),
            )
            if active
        ]
        torque = "-" if axis.torque is None else f"{axis.torque:+.2f} N·m"
        rows.append(
            (
                str(axis.axis),
                "on" if axis.servo_on else "off",
                "ALARM" if axis.alarm else "-",
                f"{axis.position:+.4f} rad",
                f"{axis.velocity:+.4f} rad/s",
                torque,
                ", ".join(switches) or "-",
            )
        )
    return columns(rows)
