"""Folder of recordings: names of new files, and removal of old ones."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path

SUFFIX = ".mcap"
PARTIAL = ".part"  # of a file that is being written
CONTINUOUS = "record"  # word in the names of continuous recordings


def default_folder() -> Path:
    """Return ``$XDG_STATE_HOME/robotd/recordings``."""
    state = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    return Path(state) / "robotd" / "recordings"


class RecordingFolder:
    """Recordings of one robot in a folder, which other robots may share. One thread.

    Args:
        path: folder; made when the first file is written, if not before.
        robot: first part of the file names.
        keep_files: number of files to keep.
        keep_bytes: size of all files to keep.
    """

    def __init__(self, path: Path, robot: str, keep_files: int, keep_bytes: float) -> None:
        self.path = path
        self._robot = robot
        self._keep_files = keep_files
        self._keep_bytes = keep_bytes

    def new_file(self, word: str) -> Path:
        """Return a free path of robot, local time and ``word``, such as "fault"."""
        stamp = time.strftime("%Y%m%d-%H%M%S")
        name = f"{self._robot}-{stamp}-{word}"
        path, number = self.path / f"{name}{SUFFIX}", 1
        while path.exists() or path.with_suffix(PARTIAL).exists():
            number += 1
            path = self.path / f"{name}-{number}{SUFFIX}"
        return path

    def remove_old(self, newest: Path) -> list[Path]:
        """Remove what exceeds number and size, oldest first; return it. Raises OSError.

        ``newest`` stays always: it looks old where the clock was set back. Continuous recordings
        do not count, and stay.
        """
        removed, size = [], 0
        files = sorted(self._files(), key=lambda file: (file[2] == newest, *file), reverse=True)
        for number, (_, file_size, path) in enumerate(files):
            size += file_size
            if number > 0 and (number >= self._keep_files or size > self._keep_bytes):
                path.unlink(missing_ok=True)
                removed.append(path)
        return removed

    def _files(self) -> Iterator[tuple[float, int, Path]]:
        for path in self.path.glob(f"{self._robot}-*{SUFFIX}"):
            if CONTINUOUS in path.stem.split("-")[1:]:  # after the name of the robot
                continue
            try:
                status = path.stat()
            except FileNotFoundError:  # removed by another process
                continue
            yield status.st_mtime, status.st_size, path
