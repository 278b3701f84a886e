"""File of a recorded path: plain YAML that a person reads, edits and versions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from robotd.api import FloatArray, InvalidArgument, RobotDescriptor
from robotd.api.features import Section, SectionProblem
from robotd.api.models import read_yaml, validate
from robotd_shared.pose_file import NAME, file_of, state_folder, write_whole
from robotd_shared.teach_keys import TeachKeys

HEAD = "# Recorded path: time in s of each point, and positions of the joints, rad or m.\n"
SUFFIX = ".yaml"
MAX_POINTS = 5000
DECIMALS = 5
SHORTEST_S = 1e-3  # between two points


class PathFile(Section):
    """Content of a file; its name is that of the path.

    Attributes:
        robot: name of the robot that was recorded.
        joints: all of one joint group.
        points: a row of each: time from 0, and the position of each joint.
    """

    robot: str
    joints: Annotated[list[str], Field(min_length=1)]
    points: Annotated[list[str], Field(min_length=2, max_length=MAX_POINTS)]

    @classmethod
    def of(
        cls, robot: str, joints: Sequence[str], times_s: FloatArray, positions: FloatArray
    ) -> PathFile:
        """Return the content for points at times (k,) and positions (k, n), rounded.

        Raises InvalidArgument: there are too many.
        """
        if len(times_s) > MAX_POINTS:
            text = f"the path needs {len(times_s)} points, at most {MAX_POINTS} can be kept"
            raise InvalidArgument(f"{text}: record it in parts")
        rows = zip(times_s.tolist(), positions.tolist(), strict=True)
        points = [
            " ".join([f"{time_s:.3f}", *(f"{position:z.{DECIMALS}f}" for position in row)])
            for time_s, row in rows
        ]
        return cls(robot=robot, joints=[*joints], points=points)

    def problems(self) -> Iterator[SectionProblem]:
        before_s, width = -SHORTEST_S, 1 + len(self.joints)
        for index, point in enumerate(self.points):
            row = _numbers(point)
            if len(row) != width or not all(map(math.isfinite, row)):
                text = f"needs {width} numbers, the time and {len(self.joints)} positions"
                yield ("points", index), text, point
            elif index == 0 and row[0] != 0.0:
                yield ("points", index), "must begin at time 0", point
            elif not row[0] > before_s + 0.9 * SHORTEST_S:
                yield ("points", index), "its time is not after that of the point before", point
            else:
                before_s = row[0]
                continue
            return

    @property
    def duration_s(self) -> float:
        """Time of the last point."""
        return _numbers(self.points[-1])[0]

    @property
    def times_s(self) -> FloatArray:
        """(k,) from 0."""
        return np.array([_numbers(point)[0] for point in self.points])

    def positions(self, joints: Sequence[str]) -> FloatArray:
        """Return positions (k, n) of ``joints``, each of which it has; rad or m."""
        columns = [1 + self.joints.index(joint) for joint in joints]
        return np.array([_numbers(point) for point in self.points])[:, columns]


def _numbers(point: str) -> list[float]:
    """Return the numbers of a row; empty: it has something else."""
    try:
        return [*map(float, point.split())]
    except ValueError:
        return []


def folder_of(descriptor: RobotDescriptor, kind: str = "paths") -> Path:
    """Return the folder of a robot's paths, or of another ``kind``, beside its poses."""
    if descriptor.settings(TeachKeys).poses is not None:
        return file_of(descriptor).parent / kind
    return state_folder() / kind / descriptor.name


def paths_in(folder: Path) -> dict[str, Path]:
    """Return the files of a folder by the name of their path, in the order of names."""
    found = sorted(folder.glob(f"*{SUFFIX}")) if folder.is_dir() else []
    return {path.stem: path for path in found if NAME.fullmatch(path.stem)}


def changes_in(folder: Path) -> dict[str, int]:
    """Return the time of the last change of each path, ns."""
    changes = {}
    for name, path in paths_in(folder).items():
        with suppress(FileNotFoundError):  # deleted meanwhile
            changes[name] = path.stat().st_mtime_ns
    return changes


def require_free(folder: Path, name: str, *, replace: bool = False) -> None:
    """Raise InvalidArgument where a path has this name already, unless it is replaced."""
    if not replace and name in paths_in(folder):
        raise InvalidArgument(f"there is a path {name!r} already: replace it, or rename it")


def read_path(path: Path) -> PathFile:
    """Return the content of a file. Raises DescriptorError, OSError."""
    tree = read_yaml(path)
    return validate(PathFile, tree.plain(), tree)


def write_path(path: Path, content: PathFile) -> None:
    """Write a file, whole or not at all. Raises OSError."""
    lines = [f"robot: {content.robot}", f"joints: [{', '.join(content.joints)}]", "points:"]
    write_whole(
        path, HEAD + "\n".join([*lines, *(f"- {point}" for point in content.points)]) + "\n"
    )
