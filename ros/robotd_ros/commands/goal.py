"""One goal of a running arm, as ``robotd move`` and ``robotd jog`` carry it out and show it."""

from __future__ import annotations

import math
import shutil
import sys
from collections.abc import Collection, Mapping, Sequence
from contextlib import nullcontext, suppress
from typing import TYPE_CHECKING

import click

from robotd.cli.exit_codes import ExitCode, Rejected
from robotd.cli.preflight import import_ros
from robotd.log import escaped
from robotd.stop_signals import Interrupt

if TYPE_CHECKING:  # it needs rclpy
    from robotd_ros.client.motion_client import Arm, Ending, OnProgress
    from robotd_ros.client.ros_client import RosClient

CLEAR_LINE = "\r\x1b[K"
BAR_WIDTH = 20


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
    return exit_code(ending, reason), reason


def exit_code(ending: Ending, reason: str) -> ExitCode:
    """Return OK, or INTERRUPTED for a canceled goal. Raises Rejected with ``reason``."""
    if ending.value == "aborted":  # by value: the class needs rclpy
        raise Rejected(reason)
    return ExitCode.INTERRUPTED if ending.value == "canceled" else ExitCode.OK


def print_ending(code: ExitCode, text: str) -> ExitCode:
    """Print how a goal ended, unless the terminal that canceled it is lost; return ``code``."""
    with suppress(OSError) if code is ExitCode.INTERRUPTED else nullcontext():
        click.echo(escaped(text))
    return code


def bar(part: float) -> str:
    """Return a bar of ``BAR_WIDTH`` characters that is filled to ``part``, 0 to 1."""
    filled = round(min(max(part, 0.0), 1.0) * BAR_WIDTH)
    return "━" * filled + "╌" * (BAR_WIDTH - filled)


class ProgressLine:
    """Shows the progress of a motion on standard error, on one line.

    Args:
        joints: those to show.
        time_s: planned duration.
        degrees: joints that are shown in degrees instead of radians.
    """

    def __init__(
        self, joints: Sequence[str], time_s: float, *, degrees: Collection[str] = ()
    ) -> None:
        self._joints = joints
        self._time_s = time_s
        self._degrees = degrees
        self._shown = False

    def show(self, passed_s: float, positions: Mapping[str, float]) -> None:
        """Show the seconds since the start, and ``positions`` in rad or m."""
        if not sys.stderr.isatty():
            return
        values = "  ".join(
            f"{joint} {self._text(joint, positions[joint])}" for joint in self._joints
        )
        line = f"{bar(passed_s / self._time_s)} {passed_s:.1f} of {self._time_s:.1f} s  {values}"
        width = shutil.get_terminal_size().columns - 1
        self._print(f"{CLEAR_LINE}{line[:width]}")
        self._shown = True

    def end(self) -> None:
        """Clear the line."""
        if self._shown:
            self._print(CLEAR_LINE)
            self._shown = False

    def _print(self, text: str) -> None:
        with suppress(OSError):  # of a lost terminal: the motion still has to be canceled
            click.echo(text, nl=False, err=True)

    def _text(self, joint: str, position: float) -> str:
        is_angle = joint in self._degrees
        return f"{math.degrees(position):+z.1f}°" if is_angle else f"{position:+z.3f}"
