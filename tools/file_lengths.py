"""Modules that are too long to be read alone.

``make lint`` fails for one. A module that is listed here may have the lines that it has: it gets
shorter, never longer.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("core/*.py", "ros/*.py", "features/*.py", "plugins/*.py", "tools/*.py")
MAX_LINES = 500
LONGER = {
    # Owners, checks and commands of axes share one lock and the time of the last command; what has
    # none of both is apart: servo_switch, axis_stops, image_waits, stop_latch, named_axes.
    "core/robotd/device/axes.py": 623,
    # The contract of a backend, most of it docstrings: an author reads it in one go, and its
    # rules of threads, units and errors are said once, at its head.
    "core/robotd/device/drivers.py": 526,
}


def too_long(lines: Mapping[str, int]) -> Iterator[str]:
    """Yield a line for each module that is too long; ``lines``: of modules by their paths."""
    for path, count in sorted(lines.items()):
        limit = LONGER.get(path, MAX_LINES)
        if count > limit:
            yield f"{path} has {count} lines, more than {limit}: move what can be read alone"
        elif path in LONGER and count <= MAX_LINES:
            yield f"{path} has {count} lines: it needs no row in tools/file_lengths.py any more"


def main() -> None:
    command = ["git", "ls-files", "--", *PACKAGES]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    paths = [path for path in listed.splitlines() if (ROOT / path).exists()]
    found = [*too_long({path: len((ROOT / path).read_bytes().splitlines()) for path in paths})]
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
