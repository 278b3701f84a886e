"""``robotd move``: move joints of a running arm."""

from __future__ import annotations

import math
from collections.abc import Mapping

import click

from robotd.cli.exit_codes import ExitCode, Rejected
from robotd.cli.preflight import import_ros
from robotd.cli.progress import Progress
from robotd.cli.shell_values import joint_completion
from robotd.number_argument import NumberRange, parse_number
from robotd_ros.commands.goal import carry_out, tell
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    client_options,
    print_addressed_robots,
    robot_client,
)

TURN = 2.0 * math.pi


def parse_targets(
    ctx: click.Context, param: click.Parameter, words: tuple[str, ...]
) -> dict[str, float]:
    """Parse ``joint1=0.5 joint3=-0.4`` into positions by joint."""
    targets: dict[str, float] = {}
    for word in words:
        joint, _, text = word.partition("=")
        if not (joint and text):
            raise click.BadParameter(f"{word!r} is not like joint1=0.5")
        try:
            position = parse_number(text)
        except ValueError:
            position = math.nan
        if not math.isfinite(position):
            raise click.BadParameter(f"{joint}: {text!r} is not a number")
        if joint in targets:
            raise click.BadParameter(f"{joint} is given twice")
        targets[joint] = position
    return targets


@click.command("move", epilog=ROS_EPILOG)
@click.argument(
    "targets",
    metavar="JOINT=POSITION...",
    nargs=-1,
    required=True,
    callback=parse_targets,
    shell_complete=joint_completion("="),
)
@click.option(
    "--time",
    "time_s",
    metavar="SECONDS",
    type=NumberRange(0.01, 3600),
    default=2.0,
    show_default=True,
    help="Duration of the motion.",
)
@click.option("--deg", is_flag=True, help="Positions of turning joints are degrees.")
@click.option("--action", metavar="NAME", help="The arm's action, where several arms run.")
@client_options
def move(
    timeout_s: float,
    *,
    targets: Mapping[str, float],
    time_s: float,
    deg: bool,
    action: str | None,
) -> ExitCode:
    """Move joints of the running arm.

    For example: robotd move joint1=0.5 joint3=-0.4. Positions are rad, or m for a prismatic joint.
    Joints that are not named stay where they are, and other joint groups go on. Ctrl-C, or
    the loss of the terminal, stops the motion and waits until the arm stands.
    """
    with robot_client(timeout_s, searches=True) as client:
        with import_ros("robotd_ros.client.problem_client").reason_of_silence(client):
            arm = import_ros("robotd_ros.client.motion_client").find_arm(client, targets, action)
        import_ros("robotd_ros.client.problem_client").require_motion(client)
        print_addressed_robots(client)
        turning = {joint for joint in targets if deg and arm.units.get(joint) != "m"}
        positions = {
            joint: math.radians(value) if joint in turning else value
            for joint, value in targets.items()
        }
        progress = Progress(tuple(targets), time_s, degrees=turning)
        try:
            code, reason = carry_out(client, arm, positions, time_s, progress.show)
        except Rejected as error:
            looks_like_degrees = any(
                abs(value) > TURN
                for joint, value in positions.items()
                if arm.units.get(joint) != "m"
            )
            advice = "; positions are rad: --deg takes degrees" if looks_like_degrees else ""
            raise Rejected(f"{error}{advice}") from error
        progress.end()
    return tell(code, reason)
