"""Classes of the core and of ``robotd_ros`` whose name another class of the packages has, too.

``make lint`` fails for one: who searches for a name finds one class. Backends may repeat each
other's names, and features those of features: nobody reads two of them at once.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("core/*.py", "ros/*.py", "features/*.py", "plugins/*.py")
OWN_NAMES = ("core/", "ros/robotd_ros/")  # files whose classes have a name of their own
ALLOWED = frozenset({"WorldCamera"})  # LeRobot finds it by the name of its configuration
CLASS = re.compile(r"^class ([A-Za-z]\w*)", re.MULTILINE)  # without those that are private


def doubled(texts: Mapping[str, str]) -> Iterator[str]:
    """Yield a line for each name, with the files; ``texts``: of modules by their paths."""
    places = defaultdict[str, list[str]](list)
    for path, text in texts.items():
        for name in CLASS.findall(text):
            places[name].append(path)
    for name, paths in sorted(places.items()):
        if len(paths) > 1 and name not in ALLOWED and any(p.startswith(OWN_NAMES) for p in paths):
            yield f"class {name} is in {' and '.join(paths)}: give one of them another name"


def main() -> None:
    command = ["git", "ls-files", "--", *PACKAGES]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    paths = [path for path in listed.splitlines() if "/tests/" not in path]
    found = [*doubled({path: (ROOT / path).read_text("utf-8") for path in paths})]
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
