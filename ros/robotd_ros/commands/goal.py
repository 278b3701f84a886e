"""One goal of a running arm, as ``robotd move`` and ``robotd jog`` carry it out."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext, suppress
from typing import TYPE_CHECKING

import click

from robotd.cli.exit_codes import ExitCode, Rejected
from robotd.cli.preflight import import_ros
from robotd.log import escaped
from robotd.stop_signals import Interrupt

if TYPE_CHECKING:  # it needs rclpy
    from robotd_ros.client.motion_client import Arm, OnProgress
    from robotd_ros.client.ros_client import RosClient


def carry_out(
    client: RosClient,
    arm: Arm,
    targets: Mapping[str, float],
    time_s: float,
    on_progress: OnProgress,
) -> tuple[ExitCode, str]:
    """Move joints to ``targets``, rad or m; return at rest, with the robot's reason.

    Ctrl-C, SIGTERM and the loss of the terminal cancel the goal: INTERRUPTED. Raises Rejected with
    the robot's reason.
    """
    motion = import_ros("robotd_ros.client.motion_client")
    with Interrupt() as interrupt:
        ending, reason = motion.move(
            client, arm, targets, time_s, lambda: interrupt.happened, on_progress
        )
    if ending is motion.Ending.ABORTED:
        raise Rejected(reason)
    canceled = ending is motion.Ending.CANCELED
    return ExitCode.INTERRUPTED if canceled else ExitCode.OK, reason


def tell(code: ExitCode, text: str) -> ExitCode:
    """Print how a goal ended, unless the terminal that canceled it is lost; return ``code``."""
    with suppress(OSError) if code is ExitCode.INTERRUPTED else nullcontext():
        click.echo(escaped(text))
    return code
