"""Paths and files named by a user: untrusted input, reported as DescriptorError."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from robotd.errors import DescriptorError


def beside(file: Path, name: str) -> Path:
    """Return the absolute path of ``name``, which is relative to the folder of ``file``."""
    return Path(os.path.normpath(file.absolute().parent / name))


def is_file(path: Path) -> bool:
    """Return True for a regular file; False for names that the system rejects."""
    return stat.S_ISREG(_mode(path))


def is_folder(path: Path) -> bool:
    """Return True for a folder; False for names that the system rejects."""
    return stat.S_ISDIR(_mode(path))


def read_limited(path: Path, max_bytes: int) -> bytes:
    """Read a regular file of at most ``max_bytes``. Raises DescriptorError."""
    # Looked at before, because opening alone starts some devices; and after, because the name
    # may have come to mean another file. O_NONBLOCK: a named pipe would wait for its writer.
    if _mode(path) and not is_file(path):
        raise DescriptorError("not a regular file", path=path)
    try:
        with open(path, "rb", opener=_open_without_waiting) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise DescriptorError("not a regular file", path=path)
            data = file.read(max_bytes + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL character in the name
        reason = getattr(error, "strerror", None) or error
        raise DescriptorError(f"cannot be read: {reason}", path=path) from None
    if len(data) > max_bytes:
        raise DescriptorError(f"larger than the limit of {max_bytes:_} bytes", path=path)
    return data


def _open_without_waiting(name: str, flags: int) -> int:
    return os.open(name, flags | os.O_NONBLOCK | os.O_NOCTTY)


def _mode(path: Path) -> int:
    try:
        return path.stat().st_mode
    except (OSError, ValueError):
        return 0
