"""``robotd jog``: move one joint of a running arm by an increment, or by keys."""

from __future__ import annotations

import math
from typing import Any

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.preflight import import_ros
from robotd.cli.shell_values import joint_completion
from robotd.number_argument import NumberRange
from robotd_ros.commands.goal import carry_out, print_ending
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    client_options,
    require_one_robot,
    robot_client,
)

DEFAULT_SPEED = 0.1  # rad/s or m/s
MIN_TIME_S, MAX_TIME_S = 0.3, 3600.0
PEAK = 2.0  # upper bound of the peak velocity of a motion over its mean velocity


def finite(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    """Reject an increment that is not finite."""
    if value is not None and not math.isfinite(value):
        raise click.BadParameter(f"{value} is not a finite number")
    return value


@click.command(
    "jog", epilog=ROS_EPILOG, context_settings={"ignore_unknown_options": True}
)  # an increment may begin with a minus
@click.argument("joint", required=False, shell_complete=joint_completion())
@click.argument(
    "increment", metavar="±INCREMENT", type=NumberRange(), callback=finite, required=False
)
@click.option("--keys", is_flag=True, help="Hold an arrow key to move, release it to stop.")
@click.option(
    "--tool",
    type=click.Choice(["base", "tool", "frame"]),
    help="With --keys: move the tool, along the axes of base, tool or chosen work frame.",
)
@click.option("--deg", is_flag=True, help="Increment and speed of turning joints are in degrees.")
@click.option(
    "--speed",
    metavar="SPEED",
    type=NumberRange(0.0, min_open=True),
    help="Highest speed on the way; 0.1 rad/s or m/s by default.",
)
@click.option("--action", metavar="NAME", help="The arm's action, where several arms run.")
@client_options
@click.pass_context
def jog(ctx: click.Context, /, *, keys: bool, **options: Any) -> ExitCode:
    """Move one joint of the running arm by an increment, or axes by keys.

    For example: robotd jog joint2 +0.01. The other joints stay where they are. Ctrl-C, or the
    loss of the terminal, stops.

    robotd jog --keys moves an axis while an arrow key is held, at --speed; with --tool base the
    tool, for which the robot needs the node servo_node.
    """
    tool = options.pop("tool")
    if keys:
        return _jog_by_keys(tool, **options)
    if tool is not None:
        raise click.UsageError("--tool needs --keys")
    for parameter in ctx.command.params[:2]:
        if options[str(parameter.name)] is None:
            raise click.MissingParameter(ctx=ctx, param=parameter)
    return _jog(**options)


def _jog_by_keys(tool: str | None, **options: Any) -> ExitCode:
    from robotd_ros.commands.keyboard_jog import jog_by_keys

    others = [name for name in ("joint", "increment", "action") if options[name] is not None]
    if others:
        raise click.UsageError(f"--keys excludes {', '.join(others)}")
    return jog_by_keys(options["timeout_s"], _speed(options["speed"], options["deg"]), tool)


def _speed(speed: float | None, deg: bool) -> float:
    """Return the speed in rad/s or m/s."""
    return DEFAULT_SPEED if speed is None else math.radians(speed) if deg else speed


def _jog(
    timeout_s: float,
    *,
    joint: str,
    increment: float,
    deg: bool,
    speed: float | None,
    action: str | None,
) -> ExitCode:
    """Move ``joint``; INTERRUPTED after Ctrl-C. Raises Rejected with the robot's reason."""
    with robot_client(timeout_s, searches=True) as client:
        arm = import_ros("robotd_ros.client.motion_client").find_arm(client, [joint], action)
        import_ros("robotd_ros.client.operator_client").require_motion(client, arm.namespace)
        require_one_robot(client, arm.namespace)
        arm.check([joint])
        unit = arm.units.get(joint, "rad or m")
        turns = deg and unit != "m"
        scale = math.radians(1.0) if turns else 1.0
        distance = increment * scale
        time_s = max(PEAK * abs(distance) / _speed(speed, turns), MIN_TIME_S)
        if time_s > MAX_TIME_S:
            chosen = f"{DEFAULT_SPEED:g} {unit}/s" if speed is None else f"--speed {speed:g}"
            raise click.BadParameter(
                f"{joint}: {increment:+g} at {chosen} would take {time_s:g} s, more than"
                f" {MAX_TIME_S:g} s"
            )
        target = arm.positions[joint] + distance
        # Shows no progress: an increment is short.
        code, reason = carry_out(client, arm, {joint: target}, time_s, lambda *_: None)
    return print_ending(code, f"{joint}: {target / scale:+z.4f} {'°' if turns else unit}; {reason}")
