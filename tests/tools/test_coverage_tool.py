"""The coverage table counts lines by package and compares the total with the floor."""

from __future__ import annotations

from typing import Any

from tools.coverage import report


def file(covered: int, missing: int) -> dict[str, Any]:
    return {"summary": {"covered_lines": covered, "missing_lines": missing}}


FILES = {
    "core/robotd/a.py": file(6, 4),
    "core/robotd/motion/b.py": file(10, 0),
    "plugins/sim/robotd_sim/c.py": file(0, 0),
    "ros/robotd_ros/d.py": file(1, 9),
}


def test_packages_and_total_are_shown() -> None:
    text, is_reached = report(FILES, 80.0)
    lines = [line.split() for line in text.splitlines()]
    assert ["core/robotd", "10", "60.0", "%"] in lines
    assert ["core/robotd/motion", "10", "100.0", "%"] in lines
    assert ["total", "20", "80.0", "%", "floor", "80", "%"] in lines
    assert ["ros/robotd_ros", "10", "10.0", "%", "not", "counted:"] in [line[:6] for line in lines]
    assert is_reached


def test_below_the_floor() -> None:
    assert not report(FILES, 80.1)[1]
