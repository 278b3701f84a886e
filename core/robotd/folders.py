"""Folders that robotd writes to."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path

FULL = (errno.ENOSPC, errno.EDQUOT)
MIB = 2**20


def why_unwritable(folder: Path, room_bytes: int = 4096) -> str:
    """Make ``folder``; return why no file of ``room_bytes`` can be written there, or ""."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            os.posix_fallocate(file.fileno(), 0, room_bytes)  # quotas count, too
            return ""
    except OSError as error:
        room = f", {room_bytes / MIB:.0f} MiB are needed" if room_bytes >= MIB else ""
        return f"{folder}: {error.strerror}{room if error.errno in FULL else ''}"
