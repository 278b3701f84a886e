"""A tool or a work frame by touching points, and into the robot's file."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from robotd.api import DescriptorError, FloatArray, load_robot_descriptor
from robotd_ros.client.ros_client import RosClient
from robotd_ros.client.tool_client import chosen_frames, tool_pose
from robotd_shared.commented_yaml import commented_yaml, on_one_line
from robotd_tool_space.frames.frame_calibration import frame_of_points, tool_tip
from robotd_tool_space.geometry.rotations import (
    inverse_pose,
    pose_of_message,
    quaternion_pose,
    rpy_of,
)

POINTS = ("the origin of the frame", "a point on its x axis", "a point on the side of its y axis")
DECIMALS = 6
BAD_M = 0.002  # of a touch, from the point that the others mean


def calibrate(
    client: RosClient, name: str, group: str, touches: int, path: Path | None, *, is_frame: bool
) -> None:
    """Ask for the touches, compute the frame, and print it or write it into a robot's file.

    Raises InvalidArgument: the touches make no frame; DescriptorError: the file is not a robot.
    """
    if is_frame:
        points = [_touch(client, group, f"Touch {what}")[1][:3, 3] for what in POINTS]
        pose = frame_of_points(*points)
        settings = {"xyz_m": _numbers(pose[:3, 3]), "rpy_rad": _numbers(rpy_of(pose))}
    else:
        text = "Touch the point with the tip of the tool, in another pose each time"
        numbers = range(1, touches + 1)
        links = [_touch(client, group, f"{number} of {touches}: {text}")[0] for number in numbers]
        found = tool_tip(links)
        worst = int(np.argmax(found.errors_m))
        click.echo(f"the touches are within {1e3 * found.errors_m[worst]:.2f} mm of one point")
        if found.errors_m[worst] > BAD_M:
            click.echo(f"touch {worst + 1} is the farthest: repeat it more exactly")
        settings = {"xyz_m": _numbers(found.xyz_m)}
    section = "work_frames" if is_frame else "tools"
    if path is None:
        values = ", ".join(f"{key}: {value}" for key, value in settings.items())
        click.echo(f"tool_space:\n  {section}:\n    {name}: {{{values}}}")
        return
    write_frame(path, section, name, settings)
    click.echo(f"{path} has {section}.{name}: it is in force after a restart")


def write_frame(path: Path, section: str, name: str, settings: dict[str, list[float]]) -> None:
    """Write a frame into a robot's file, with its comments, whole or not at all.

    Raises DescriptorError: the file is not a robot, or would be none afterwards; it is as before.
    """
    load_robot_descriptor(path)
    before = path.read_text(encoding="utf-8")
    yaml = commented_yaml()
    tree = yaml.load(before)
    place = tree
    for key in ("tool_space", section):
        if place.get(key) is None:
            place[key] = {}
        place = place[key]
    place[name] = on_one_line(settings)
    text = io.StringIO()
    yaml.dump(tree, text)
    part = path.with_name(f".{path.name}.part.yaml")
    part.write_text(text.getvalue(), encoding="utf-8")
    try:
        load_robot_descriptor(part)
        os.replace(part, path)  # noqa: PTH105 - atomic, which is its purpose
    except DescriptorError as error:
        raise DescriptorError(f"{path} would not be valid: {error}") from None
    finally:
        part.unlink(missing_ok=True)


def _touch(client: RosClient, group: str, text: str) -> tuple[FloatArray, FloatArray]:
    """Wait for Enter; return the poses (4, 4) of link and tool in the base."""
    click.echo(f"{text}, then press Enter.")
    if not sys.stdin.readline():
        raise click.Abort
    message, frame_name, tool_name = tool_pose(client, group)
    frames = {
        stamped.child_frame_id: _pose_of_transform(stamped.transform)
        for stamped in chosen_frames(client)
    }
    pose = _chosen(frames, frame_name) @ pose_of_message(message)
    return pose @ inverse_pose(_chosen(frames, tool_name)), pose


def _chosen(frames: dict[str, FloatArray], name: str) -> FloatArray:
    """Return the frame of a name, which may have a prefix on ROS; none is the link, or the base."""
    found = [pose for child, pose in frames.items() if child.endswith(name)]
    return found[0] if found else np.eye(4)


def _pose_of_transform(transform: Any) -> FloatArray:
    place, turn = transform.translation, transform.rotation
    return quaternion_pose((place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))


def _numbers(values: Sequence[float] | FloatArray) -> list[float]:
    return [round(float(value), DECIMALS) + 0.0 for value in values]
