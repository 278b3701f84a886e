"""``robotd guide``: move the arm by hand."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import click

from robotd.api.commands import ExitCode, Interrupt, NumberRange, escaped, import_ros
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    client_options,
    require_one_robot,
    robot_client,
)
from robotd_teach.status_line import StatusLine


@click.command("guide", epilog=ROS_EPILOG)
@click.option("--group", default="", metavar="NAME", help="Joint group, where there are several.")
@click.option("--held", is_flag=True, help="Somebody holds the arm, which may have no torque.")
@click.option(
    "--max-speed",
    type=NumberRange(0.1, 10.0),
    default=1.5,
    show_default=True,
    help="Speed of a joint, rad/s or m/s, that ends it.",
)
@click.option(
    "--for",
    "for_s",
    metavar="SECONDS",
    type=NumberRange(1.0, 3600.0),
    default=600.0,
    show_default=True,
    help="How long at most.",
)
@click.option(
    "--lease",
    "lease_s",
    metavar="SECONDS",
    type=NumberRange(0.2, 60.0),
    default=1.0,
    show_default=True,
    help="Silence of this command after which the robot ends it.",
)
@client_options
def guide(
    timeout_s: float, *, group: str, held: bool, max_speed: float, for_s: float, lease_s: float
) -> ExitCode:
    """Let the joints be moved by hand, until Ctrl-C.

    An arm with serial servos has no torque meanwhile: hold it before you begin, and say so with
    --held. At the end the joints are held where they are. A stop, a pause, a fault, a joint that
    is moved too fast, the end of the time, and the loss of this command or of the robot end it,
    too.
    """
    client_module = import_ros("robotd_teach.guide_client")
    values = {"group": group, "held": held, "max_speed": max_speed, "timeout_s": for_s}
    with robot_client(timeout_s) as client:
        require_one_robot(client)
        show = _Positions()
        with Interrupt() as interrupt:
            try:
                text = client_module.guide(
                    client, values, lease_s, lambda: interrupt.happened, show
                )
            finally:
                show.end()
    with suppress(OSError):  # of a lost terminal
        click.echo(escaped(text))
    return ExitCode.OK


class _Positions(StatusLine):
    """Says that guiding has begun, and shows the joints on a line of a terminal."""

    _begun = False

    def __call__(self, state: Any) -> None:
        if not self._begun:
            self._begun = True
            self.keep(f"{', '.join(state.joints)} can be moved by hand; Ctrl-C ends it")
        positions = " ".join(f"{position:+z.3f}" for position in state.positions)
        self.replace(f"{positions}  {state.speed:.2f}/s  {state.left_s:.0f} s left")
