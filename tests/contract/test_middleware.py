"""Workarounds of rclpy and the DDS: one door, and a reason for each."""

from __future__ import annotations

from pathlib import Path

SOURCES = Path(__file__).parents[2] / "ros" / "robotd_ros"


def test_every_workaround_says_what_it_is_for() -> None:
    for path in (SOURCES / "middleware").glob("*.py"):
        text = path.read_text(encoding="utf-8").partition('"""\n\n')[0]
        if path.name == "__init__.py" or "Part of ``cdr.py``" in text:
            continue
        for heading in ("Works around: ", "Measured: ", "Upstream: ", "Shown by: "):
            assert f"\n{heading}" in text, f"{path.name}: {heading}"
        shown = text.partition("Shown by: ")[2].strip().rstrip(".").split(", ")
        for name in shown:
            assert (SOURCES.parents[1] / name.strip()).is_file(), f"{path.name}: {name}"


def test_other_modules_use_the_one_door() -> None:
    for path in SOURCES.rglob("*.py"):
        if path.parent.name != "middleware":
            text = path.read_text(encoding="utf-8")
            assert "robotd_ros.middleware." not in text, path
