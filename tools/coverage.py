"""``make coverage``: run the unit and contract tests, report line coverage, enforce a floor.

SlipCover measures by instrumented bytecode. On Python 3.11 it adds 24 % of processor time to the
tests of plugins, descriptor and control (48 s to 59 s); coverage.py adds 150 % (120 s), and tests
with time limits fail. Processes that tests start are not measured, so packages that are tested over
DDS or a bus, in processes of their own, are shown and do not count for the floor.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
RESULT = ROOT / "build" / "coverage.json"
SOURCES = (
    "core/robotd",
    "features",
    "plugins/bases",
    "plugins/canopen",
    "plugins/cia402",
    "plugins/ethercat",
    "plugins/servo_model",
    "plugins/sim",
    "plugins/wmx_commands",
    "ros/robotd_messages",
    "ros/robotd_ros",
)
ELSEWHERE = (
    "features/commissioning/robotd_commissioning",
    "features/conformance/robotd_conformance",
    "features/foxglove/robotd_foxglove",
    "features/page/robotd_page",
    "ros/robotd_ros",
    "features/scenario/robotd_scenario",
    "features/tool_space/robotd_tool_space",
    "features/shared/robotd_shared",
    "features/testing/robotd_testing",
    "plugins/canopen",
    "plugins/ethercat",
)
"""Tested over DDS, buses and browsers: by the folders of REAL_TIME in tests/conftest.py."""
FLOOR_PERCENT = 95.0
"""Lowest accepted coverage of the other packages."""

_SLIPCOVER = ("-m", "slipcover", "--source", ",".join(SOURCES), "--json", "--out", str(RESULT))
_PYTEST = ("-m", "pytest", "-W", "ignore:Module already imported", "--units")


def run_tests(arguments: Sequence[str]) -> int:
    """Run the tests with ``arguments`` for pytest; return their exit status."""
    RESULT.parent.mkdir(exist_ok=True)
    command = [sys.executable, *_SLIPCOVER, *_PYTEST, *arguments]
    return subprocess.run(command, cwd=ROOT, check=False).returncode


def by_package(files: Mapping[str, Any]) -> dict[str, tuple[int, int]]:
    """Return covered and all lines of each package, two folders deep, sorted by name."""
    found: dict[str, tuple[int, int]] = {}
    for name, file in files.items():
        package = "/".join(Path(name).parent.parts[:3])
        covered, lines = found.get(package, (0, 0))
        summary = file["summary"]
        covered += summary["covered_lines"]
        lines += summary["covered_lines"] + summary["missing_lines"]
        found[package] = (covered, lines)
    return dict(sorted(found.items()))


def report(files: Mapping[str, Any], floor_percent: float = FLOOR_PERCENT) -> tuple[str, bool]:
    """Return a table of packages with the total, and whether the total reaches the floor."""
    lines, covered, total = [f"{'package':38} {'lines':>6} covered"], 0, 0
    for name, (hit, count) in by_package(files).items():
        is_counted = not name.startswith(ELSEWHERE)
        note = "" if is_counted else "   not counted: tested by others"
        if count:
            lines.append(f"{name:38} {count:6} {100.0 * hit / count:5.1f} %{note}")
        covered += hit * is_counted
        total += count * is_counted
    percent = 100.0 * covered / total
    lines.append(f"{'total':38} {total:6} {percent:5.1f} %   floor {floor_percent:g} %")
    return "\n".join(lines), percent >= floor_percent


def main() -> None:
    """Run and report; with ``--report`` only report the last run."""
    arguments = sys.argv[1:]
    status = 0 if arguments == ["--report"] else run_tests(arguments)
    text, is_reached = report(json.loads(RESULT.read_text(encoding="utf-8"))["files"])
    print(text)
    if not is_reached:
        print(f"coverage is below the floor of {FLOOR_PERCENT:g} %: test what you added")
    sys.exit(status or not is_reached)


if __name__ == "__main__":
    main()
