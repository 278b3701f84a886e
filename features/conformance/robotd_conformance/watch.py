"""Source files of a backend, and waiting for one of them to change."""

from __future__ import annotations

import time
from importlib.util import find_spec
from pathlib import Path

from robotd.api.robots import find_backend

POLL_S = 0.3
SUFFIXES = {".py", ".yaml", ".json", ".so"}


def source_files(backend: str) -> dict[Path, int]:
    """Return the files of the package that has ``backend``, and when each was changed, ns."""
    _, entry = find_backend(backend)
    spec = find_spec(entry.module.partition(".")[0])
    folders = list(spec.submodule_search_locations or ()) if spec else []
    found = [Path(spec.origin)] if spec and spec.origin and not folders else []
    for folder in folders:
        found += [path for path in Path(folder).rglob("*") if path.suffix in SUFFIXES]
    return {path: path.stat().st_mtime_ns for path in found if path.exists()}


def wait_for_change(backend: str, before: dict[Path, int]) -> list[Path]:
    """Wait until files differ from ``before``; return those that do. Ctrl-C ends it."""
    while True:
        now = source_files(backend)
        changed = [path for path in now.keys() | before.keys() if now.get(path) != before.get(path)]
        if changed:
            time.sleep(POLL_S)  # an editor may write several files
            return sorted(changed)
        time.sleep(POLL_S)
