"""File of poses: names, and the positions of joints. Plain YAML that a person reads and edits."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

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


class PoseFile(Section):
    """Content of a file."""

    poses: dict[str, dict[str, float]] = Field(description="Positions by joint, by pose.")


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
    if not path.exists():
        return {}
    tree = read_yaml(path)
    return validate(PoseFile, tree.plain(), tree).poses


def write_poses(path: Path, poses: Poses) -> None:
    """Write a file, whole or not at all. Raises OSError."""
    rounded = {
        name: {joint: round(position, DECIMALS) + 0.0 for joint, position in joints.items()}
        for name, joints in poses.items()
    }
    text = HEAD + yaml.safe_dump({"poses": rounded}, sort_keys=False, default_flow_style=None)
    write_whole(path, text)


def write_whole(path: Path, text: str) -> None:
    """Write a file, whole or not at all, and the folders that it needs. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)  # noqa: PTH105 - atomic, which is its purpose


def check_name(name: str, kind: str = "pose") -> None:
    """Raise InvalidArgument for what is no name of a pose, or of another ``kind``."""
    if not NAME.fullmatch(name):
        text = "a letter, then at most 62 letters, digits, _ and -"
        raise InvalidArgument(f"{name!r} is no name of a {kind}: {text}")
