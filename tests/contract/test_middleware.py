"""Workarounds of rclpy and the DDS: one door, and a reason for each."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from robotd_ros.middleware import use_profiles

SOURCES = Path(__file__).parents[2] / "ros" / "robotd_ros"


def test_every_workaround_says_what_it_is_for() -> None:
    for path in (SOURCES / "middleware").glob("*.py"):
        text = path.read_text(encoding="utf-8").partition('"""\n\n')[0]
        if path.name == "__init__.py" or "Part of ``cdr.py``" in text:
            continue
        for heading in ("Works around: ", "Measured: ", "Upstream: ", "Ends with: ", "Shown by: "):
            assert f"\n{heading}" in text, f"{path.name}: {heading}"
        shown = text.partition("Shown by: ")[2].strip().rstrip(".").split(", ")
        for name in shown:
            assert (SOURCES.parents[1] / name.strip()).is_file(), f"{path.name}: {name}"


def test_other_modules_use_the_one_door() -> None:
    for path in SOURCES.rglob("*.py"):
        if path.parent.name != "middleware":
            text = path.read_text(encoding="utf-8")
            assert "robotd_ros.middleware." not in text, path
            assert "rclpy._" not in text, path


@pytest.mark.parametrize(("distro", "used"), [("jazzy", True), ("kilted", False)])
def test_the_profiles_are_for_the_supported_distribution(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, distro: str, used: bool
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE"):
        monkeypatch.setenv(name, "")  # put back afterwards
    monkeypatch.setenv("ROS_DISTRO", distro)
    use_profiles()
    assert bool(os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"]) is used
