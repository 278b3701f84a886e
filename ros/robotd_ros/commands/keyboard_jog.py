"""Keyboard jog: hold a key to move a joint, release it to stop."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import click
from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from robotd.cli.exit_codes import ExitCode
from robotd.cli.preflight import import_ros
from robotd.stop_signals import Interrupt
from robotd_ros.commands.jog_keys import JogKeys, KeyInput
from robotd_ros.commands.robot_client import require_one_robot, robot_client

if TYPE_CHECKING:  # it needs rclpy
    from robotd_ros.client.jog_client import JogClient, JogState

SEND_PERIOD_S = 0.02
DISPLAY_PERIOD_S = 0.1
HELP = "←/→ hold to move   1-9 {what}   +/- speed   q end   any other key stops"


def jog_by_keys(timeout_s: float, speed: float, tool: str | None = None) -> ExitCode:
    """Jog until a key, a signal or the loss of the terminal.

    ``tool``: jog the tool, in the axes of "base", "tool" or "frame"; None: the axes of the robot.

    Everything is at rest then. Raises Rejected with the robot's reason where motion is not allowed.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise click.UsageError("--keys needs a terminal")
    with robot_client(timeout_s) as client:
        import_ros("robotd_ros.client.operator_client").require_ready(client)
        require_one_robot(client)
        with (
            import_ros("robotd_ros.client.jog_client").jog_client(client, tool) as jog,
            Interrupt() as interrupt,
            KeyInput(sys.stdin.fileno()) as key_input,
        ):
            keys = JogKeys(len(jog.choices), speed)
            directions = () if tool is None else jog.choices
            try:
                with suppress(OSError), Live(auto_refresh=False) as live:  # of a lost terminal
                    sender, shown_s = _Sender(jog, keys), 0.0
                    while not (keys.ended or interrupt.happened or key_input.lost):
                        client.spin()
                        now_s = time.monotonic()
                        keys.feed(key_input.read(), now_s)
                        sender.send(now_s)
                        if now_s - shown_s >= DISPLAY_PERIOD_S:
                            shown_s = now_s
                            live.update(jog_view(jog.state(), keys, directions), refresh=True)
            finally:
                jog.jog(keys.joint, 0.0, keys.speed)
                jog.wait_at_rest()
    with suppress(OSError):
        click.echo("at rest")
    return ExitCode.OK if keys.ended else ExitCode.INTERRUPTED


class _Sender:
    """Sends the velocity of the chosen joint, and one 0 at its end."""

    def __init__(self, jog: JogClient, keys: JogKeys) -> None:
        self._jog, self._keys = jog, keys
        self._joint, self._velocity, self._sent_s = 0, 0.0, 0.0

    def send(self, now_s: float) -> None:
        """Send what the keys ask for, if it has changed or is due again."""
        velocity, joint = self._keys.velocity(now_s), self._keys.joint
        if self._velocity and joint != self._joint:
            self._jog.jog(self._joint, 0.0, self._keys.speed)
        is_due = velocity != 0.0 and now_s - self._sent_s >= SEND_PERIOD_S
        if is_due or (joint, velocity) != (self._joint, self._velocity):
            self._jog.jog(joint, velocity, self._keys.speed)
            self._joint, self._velocity, self._sent_s = joint, velocity, now_s


def jog_view(state: JogState, keys: JogKeys, directions: Sequence[str] = ()) -> Group:
    """Return the view of one state; ``directions`` of the tool that keys choose, if any."""
    help_text = HELP.format(what="direction" if directions else "joint")
    table = Table("", "joint", "servo", box=None, header_style="dim")
    table.add_column("position", justify="right")
    table.add_column("velocity", justify="right")
    for axis in state.axes or ():
        chosen = not directions and axis.axis == keys.joint
        servo = "ALARM" if axis.alarm else "on" if axis.servo_on else "off"
        table.add_row(
            str(axis.axis + 1),
            Text(axis.name, style="bold" if chosen else ""),
            Text(servo, style="" if servo == "on" else "yellow"),
            f"{axis.position:+z.4f} {axis.unit}",
            f"{axis.velocity:+z.4f} {axis.unit}/s",
            style="reverse" if chosen else "",
        )
    return Group(
        table,
        *(
            Text(f"{index + 1} {name}", style="reverse" if index == keys.joint else "")
            for index, name in enumerate(directions)
        ),
        Text(f"speed {keys.speed:g} rad/s or m/s", style="bold"),
        Text(state.blocked_by or help_text, style="bold yellow" if state.blocked_by else "dim"),
    )
