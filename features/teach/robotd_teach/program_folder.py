"""Folder of a robot's programs: the files that the page lists and edits."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from robotd.api import InvalidArgument, NotReady, unknown_name
from robotd.api.robots import Robot
from robotd_shared.pose_file import NAME, check_name, write_whole
from robotd_teach.path_file import folder_of
from robotd_teach.program_code import Program

SUFFIX = ".yaml"
CHANGED = "was changed since it was shown: look, and do it again"


class ProgramFolder:
    """Programs of a robot by name: ``robot.feature(ProgramFolder)``. Any worker thread.

    Files are read for each question, so that what a person edits counts at once.

    Attributes:
        path: of the folder, ``programs`` beside ``paths``; it may not exist.
    """

    def __init__(self, robot: Robot) -> None:
        self.path = folder_of(robot.descriptor, "programs")
        self._lock = threading.Lock()  # of writing

    def all(self) -> dict[str, str]:
        """Return the version of each program by name; it differs after each change."""
        found = sorted(self.path.glob(f"*{SUFFIX}")) if self.path.is_dir() else []
        return {file.stem: version_of(file) for file in found if NAME.fullmatch(file.stem)}

    def file(self, name: str) -> Path:
        """Return the file of a program. Raises InvalidArgument: there is none."""
        if name not in (known := self.all()):
            raise InvalidArgument(unknown_name("program", name, known))
        return self.path / f"{name}{SUFFIX}"

    def read(self, name: str) -> Program:
        """Return a program. Raises InvalidArgument: unknown; DescriptorError: it is wrong."""
        return Program.read(self.file(name))

    def create(self, name: str, text: str) -> None:
        """Write a new program. Raises InvalidArgument: no name, or taken; DescriptorError."""
        check_name(name, "program")
        file = self.path / f"{name}{SUFFIX}"
        Program.parse(text, file)
        with self._lock:
            if file.exists():
                raise InvalidArgument(f"there is a program {name!r} already")
            write_whole(file, text)

    def change(self, name: str, version: str, edit: Callable[[str], str]) -> None:
        """Replace the text of a program by what ``edit`` returns for it, whole or not at all.

        Raises:
            InvalidArgument: unknown; what ``edit`` raises.
            NotReady: the file has another version.
            DescriptorError: the result is wrong; nothing is written.
        """
        file = self.file(name)
        with self._lock:
            if version_of(file) != version:
                raise NotReady(f"{name} {CHANGED}")
            text = edit(file.read_text(encoding="utf-8"))
            Program.parse(text, file)
            write_whole(file, text)


def version_of(file: Path) -> str:
    """Return a text that differs after each change of a file; "": it cannot be read."""
    try:
        return str(file.stat().st_mtime_ns)
    except OSError:
        return ""
