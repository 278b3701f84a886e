"""Classes whose name another class has, too, where one reader could take one for the other.

``make lint`` fails for one: who searches for a name finds one class. Those of the core and of
``robotd_ros`` differ from all others, those of features from each other, and those of a plugin from
each other. Backends may repeat each other's names: nobody reads two of them at once. So may
simulated devices, which share no code with their backend, and a feature those of a backend.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("core/*.py", "ros/*.py", "features/*.py", "plugins/*.py")
EVERYWHERE = ("core/", "ros/robotd_ros/")  # their classes differ from all others
ALLOWED = frozenset({"WorldCamera"})  # LeRobot finds it by the name of its configuration
CLASS = re.compile(r"^class ([A-Za-z]\w*)", re.MULTILINE)  # without those that are private


def doubled(texts: Mapping[str, str]) -> Iterator[str]:
    """Yield a line for each name, with the files; ``texts``: of modules by their paths."""
    places = defaultdict[str, list[str]](list)
    for path, text in texts.items():
        for name in CLASS.findall(text):
            places[name].append(path)
    for name, paths in sorted(places.items()):
        if name in ALLOWED:
            continue
        scopes = Counter(map(_scope, paths))
        if len(paths) > 1 and ("" in scopes or max(scopes.values()) > 1):
            yield f"class {name} is in {' and '.join(paths)}: give one of them another name"


def _scope(path: str) -> str:
    """Return the part of the packages in which a name means one class; "": all of them."""
    if path.startswith(EVERYWHERE):
        return ""
    kind, package, *folders = path.split("/")
    if kind != "plugins":
        return kind
    return f"{package}, simulated" if "simulated" in folders else package


def main() -> None:
    command = ["git", "ls-files", "--", *PACKAGES]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    paths = [path for path in listed.splitlines() if "/tests/" not in path]
    found = [*doubled({path: (ROOT / path).read_text("utf-8") for path in paths})]
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
