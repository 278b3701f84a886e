"""File of poses: positions of joints, and pose of the tool. YAML that a person reads and edits."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml
from pydantic import Field

from robotd.api import InvalidArgument, RobotDescriptor
from robotd.api.features import Section
from robotd.api.models import beside, read_yaml, validate
from robotd_shared.teach_keys import TeachKeys

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,62}")
HEAD = "# Poses by name: positions of joints, rad or m. `robotd pose` writes this file anew.\n"
DECIMALS = 6

Poses = Mapping[str, Mapping[str, float]]


class SavedToolPose(Section):
    """Pose of a tool in a work frame: m, and rad about the fixed axes x, y, z.

    Attributes:
        tool: name of the tool, "" for the link itself.
        work_frame: name of the work frame, "" for the base of the arm.
    """

    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    tool: str = ""
    work_frame: str = ""


class PoseFile(Section):
    """Content of a file."""

    poses: dict[str, dict[str, float]] = Field(description="Positions by joint, by pose.")
    tool_poses: dict[str, SavedToolPose] = Field({}, description="Pose of the tool there, by pose.")


def file_of(descriptor: RobotDescriptor) -> Path:
    """Return the file of a robot: the key ``poses``, or one in the user's folder for state."""
    chosen = descriptor.settings(TeachKeys).poses
    if chosen is not None:
        return beside(descriptor.path, chosen) if descriptor.path else Path(chosen).absolute()
    return state_folder() / "poses" / f"{descriptor.name}.yaml"


def state_folder() -> Path:
    """Return robotd's folder for what it was taught, of robots whose file names none."""
    state = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    return Path(state) / "robotd"


def read_poses(path: Path) -> dict[str, dict[str, float]]:
    """Return the poses of a file, none where it does not exist. Raises DescriptorError."""
    return read_pose_file(path).poses


def read_pose_file(path: Path) -> PoseFile:
    """Return the content of a file, none where it does not exist. Raises DescriptorError."""
    if not path.exists():
        return PoseFile(poses={})
    tree = read_yaml(path)
    return validate(PoseFile, tree.plain(), tree)


def write_poses(
    path: Path, poses: Poses, tool_poses: Mapping[str, SavedToolPose] = MappingProxyType({})
) -> None:
    """Write a file, whole or not at all. Raises OSError.

    ``tool_poses``: by pose; those of other names are left out.
    """
    content = {"poses": {name: _rounded(joints) for name, joints in poses.items()}}
    tools = {name: tool_poses[name] for name in poses if name in tool_poses}
    if tools:
        content["tool_poses"] = {
            name: _rounded(pose.model_dump(exclude_defaults=True)) for name, pose in tools.items()
        }
    text = HEAD + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=200)
    write_whole(path, text)


def _rounded(values: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: round(value, DECIMALS) + 0.0 if isinstance(value, float) else value
        for name, value in values.items()
    }


def write_whole(path: Path, text: str) -> None:
    """Write a file, whole or not at all, and the folders that it needs. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)  # noqa: PTH105 - atomic, which is its purpose


def check_name(name: str, kind: str = "pose") -> None:
    """Raise InvalidArgument for what is not a valid name of a pose, or of another ``kind``."""
    if not NAME.fullmatch(name):
        text = "a letter, then at most 62 letters, digits, _ and -"
        raise InvalidArgument(f"{name!r} is not a valid name of a {kind}: {text}")
