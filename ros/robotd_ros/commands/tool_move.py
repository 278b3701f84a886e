"""``robotd move --tool`` and ``--pose``: the words of a pose, and the motion."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from robotd.cli.exit_codes import ExitCode
from robotd.cli.preflight import import_ros
from robotd.descriptor.urdf import transform_numbers
from robotd.descriptor.urdf.urdf_model import frame
from robotd.number_argument import parse_number
from robotd.stop_signals import Interrupt
from robotd_ros.commands.goal import CLEAR_LINE, bar, exit_code
from robotd_ros.rotations import roll_pitch_yaw

if TYPE_CHECKING:  # it needs rclpy
    from robotd_ros.client.ros_client import RosClient

COMPONENTS = ("x", "y", "z", "roll", "pitch", "yaw")
_WORD = re.compile(r"([a-z]+)([=+-])(.+)")


def parse_components(words: Sequence[str], *, deg: bool) -> tuple[dict[str, float], bool]:
    """Parse ``z+0.05`` or ``x=0.3 yaw=1.2``; return components, m and rad, and whether relative.

    Raises click.BadParameter: a word is none, or some are relative and some are not.
    """
    found: dict[str, float] = {}
    kinds = set()
    for word in words:
        match = _WORD.fullmatch(word)
        if match is None or match[1] not in COMPONENTS:
            names = ", ".join(COMPONENTS)
            raise click.BadParameter(f"{word!r} is not like z+0.05 or x=0.3; components: {names}")
        name, kind, text = match.groups()
        try:
            value = parse_number(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise click.BadParameter(f"{name}: {text!r} is not a number")
        if name in found:
            raise click.BadParameter(f"{name} is given twice")
        if deg and name in COMPONENTS[3:]:
            value = math.radians(value)
        found[name] = -value if kind == "-" else value
        kinds.add(kind == "=")
    if len(kinds) > 1:
        raise click.BadParameter("either all words have = or none has")
    return found, kinds == {False}


def move_tool(
    client: RosClient,
    components: Mapping[str, float],
    *,
    relative: bool,
    frame_name: str,
    **goal: Any,
) -> tuple[ExitCode, str]:
    """Move the tool; return at rest, with the robot's reason.

    Args:
        components: x, y, z in m, roll, pitch, yaw in rad; others stay, or are 0 if ``relative``.
        relative: they are a displacement along the axes of ``frame_name``, "base" or "tool".
        goal: further fields of the goal.

    Ctrl-C, SIGTERM and the loss of the terminal cancel the goal: INTERRUPTED. Raises Rejected with
    the robot's reason.
    """
    values = dict.fromkeys(COMPONENTS, 0.0)
    if not relative:
        tools = import_ros("robotd_ros.client.tool_client")
        values = components_of(tools.tool_pose(client, goal.get("group", ""))[0])
    pose = pose_message({**values, **components})
    return move_tool_to(client, pose, frame=frame_name if relative else "", **goal)


def move_tool_to(client: RosClient, pose: Any, **goal: Any) -> tuple[ExitCode, str]:
    """Move the tool to a geometry_msgs/Pose; ``goal``, result and errors as in ``move_tool``."""
    tools = import_ros("robotd_ros.client.tool_client")
    with Interrupt() as interrupt:
        ending, reason = tools.move_tool(client, [pose], lambda: interrupt.happened, _show, **goal)
    if sys.stderr.isatty():
        click.echo(CLEAR_LINE, err=True, nl=False)
    return exit_code(ending, reason), reason


def pose_message(values: Mapping[str, float]) -> Any:
    """Return a geometry_msgs/Pose of x, y, z, roll, pitch, yaw."""
    numbers = np.array([values[name] for name in COMPONENTS], np.float64)
    x, y, z, qx, qy, qz, qw = map(float, transform_numbers(frame(numbers[:3], numbers[3:])))
    pose = import_ros("geometry_msgs.msg").Pose()
    pose.position.x, pose.position.y, pose.position.z = x, y, z
    turn = pose.orientation
    turn.x, turn.y, turn.z, turn.w = qx, qy, qz, qw
    return pose


def components_of(pose: Any) -> dict[str, float]:
    """Return x, y, z, roll, pitch, yaw of a geometry_msgs/Pose."""
    place, turn = pose.position, pose.orientation
    values = place.x, place.y, place.z, *roll_pitch_yaw(turn.x, turn.y, turn.z, turn.w)
    return dict(zip(COMPONENTS, values, strict=True))


def _show(part: float, pose: Any) -> None:
    if sys.stderr.isatty():
        place = pose.position
        text = f"{bar(part)}  x {place.x:.3f}  y {place.y:.3f}  z {place.z:.3f} m"
        click.echo(f"{CLEAR_LINE}{text}", err=True, nl=False)
