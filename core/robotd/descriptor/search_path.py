"""Folders in which robots are found by name."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

from robotd.descriptor.files import is_file, is_folder
from robotd.errors import DescriptorError, unknown_name

FILE_NAME = "robot.yaml"
URDF_SUFFIXES = (".urdf", ".xacro")


def default_search_path() -> tuple[Path, ...]:
    """Return the folder of the robots that robotd ships; empty where not installed."""
    spec = find_spec("robotd_robots")
    return tuple(Path(folder) for folder in (spec and spec.submodule_search_locations) or ())


def find_robot(robot: str | Path, search_path: Sequence[Path] | None) -> Path:
    """Return the file of a robot, by its name or path. Raises DescriptorError."""
    path = Path(robot)
    if path.suffix in URDF_SUFFIXES:
        what = f"{robot} has no drives and limits of a robot: robotd new-robot NAME --urdf {robot}"
        raise DescriptorError(f"{what} makes a robot of it")
    if isinstance(robot, Path) or os.sep in robot or robot.endswith(".yaml"):
        return path / FILE_NAME if is_folder(path) else path
    robots = list(robots_in(search_path))
    found = [path for name, path in robots if name == robot]
    if len(found) == 1:
        return found[0]
    if found:
        raise DescriptorError(f"robot {robot!r} exists twice: {found[0]} and {found[1]}")
    what = unknown_name("robot", robot, sorted({name for name, _ in robots}))
    if is_file(Path(robot) / FILE_NAME):
        what += f"; the folder is named by its file: {Path(robot) / FILE_NAME}"
    raise DescriptorError(what)


def robots_in(search_path: Sequence[Path] | None) -> Iterator[tuple[str, Path]]:
    """Yield name and file of every robot of the search path; None: the default one."""
    for folder in default_search_path() if search_path is None else search_path:
        for path in sorted(folder.glob(f"*/{FILE_NAME}")):
            yield path.parent.name, path
