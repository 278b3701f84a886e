"""``robotd move``: move joints of a running arm."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import click

from robotd.cli.exit_codes import ExitCode, Rejected
from robotd.cli.preflight import import_ros
from robotd.cli.shell_values import joint_completion
from robotd.number_argument import NumberRange, parse_number
from robotd_ros.commands.goal import ProgressLine, carry_out, print_ending
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    client_options,
    require_one_robot,
    robot_client,
)
from robotd_ros.commands.tool_move import move_tool, parse_components

TURN = 2.0 * math.pi


def parse_targets(words: Sequence[str]) -> dict[str, float]:
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
    "words",
    metavar="JOINT=POSITION...",
    nargs=-1,
    required=True,
    shell_complete=joint_completion("="),
)
@click.option(
    "--time",
    "time_s",
    metavar="SECONDS",
    type=NumberRange(0.01, 3600),
    default=2.0,
    show_default=True,
    help="Duration of the motion of joints.",
)
@click.option("--deg", is_flag=True, help="Positions of turning joints, and angles, are degrees.")
@click.option("--action", metavar="NAME", help="The arm's action, where several arms run.")
@click.option(
    "--tool",
    "--pose",
    "tool",
    is_flag=True,
    help="Move the tool: words are z+0.05 or x=0.3, of x y z roll pitch yaw; m and rad.",
)
@click.option("--line", is_flag=True, help="Along a straight line of the tool.")
@click.option(
    "--frame",
    type=click.Choice(["base", "tool"]),
    default="base",
    show_default=True,
    help="Axes of words like z+0.05.",
)
@click.option(
    "--speed",
    type=NumberRange(0.01, 1.0),
    default=1.0,
    show_default=True,
    help="Part of the speed of the tool.",
)
@click.option("--group", default="", metavar="NAME", help="Joint group of the tool.")
@click.option("--plan", "plan_only", is_flag=True, help="Plan the motion of the tool only.")
@client_options
def move(
    timeout_s: float,
    *,
    words: tuple[str, ...],
    time_s: float,
    deg: bool,
    action: str | None,
    tool: bool,
    frame: str,
    **goal: Any,
) -> ExitCode:
    """Move joints of the running arm.

    For example: robotd move joint1=0.5 joint3=-0.4. Positions are rad, or m for a prismatic joint.
    Joints that are not named stay where they are, and other joint groups go on. Ctrl-C, or
    the loss of the terminal, stops the motion and waits until the arm is at rest.

    With --tool or --pose the tool moves: robotd move --tool z+0.05 --line goes up by 5 cm, and
    robotd move --pose x=0.3 yaw=1.2 to a pose whose other components stay.
    """
    if tool or goal["line"]:
        return _move_tool(timeout_s, words, deg=deg, frame=frame, goal=goal)
    targets = parse_targets(words)
    with robot_client(timeout_s, searches=True) as client:
        arm = import_ros("robotd_ros.client.motion_client").find_arm(client, targets, action)
        import_ros("robotd_ros.client.operator_client").require_motion(client, arm.namespace)
        require_one_robot(client, arm.namespace)
        turning = {joint for joint in targets if deg and arm.units.get(joint) != "m"}
        positions = {
            joint: math.radians(value) if joint in turning else value
            for joint, value in targets.items()
        }
        progress = ProgressLine(tuple(targets), time_s, degrees=turning)
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
    return print_ending(code, reason)


def _move_tool(
    timeout_s: float, words: Sequence[str], *, deg: bool, frame: str, goal: Mapping[str, Any]
) -> ExitCode:
    components, relative = parse_components(words, deg=deg)
    with robot_client(timeout_s) as client:
        import_ros("robotd_ros.client.operator_client").require_motion(client)
        require_one_robot(client)
        code, reason = move_tool(client, components, relative=relative, frame_name=frame, **goal)
    return print_ending(code, reason)
