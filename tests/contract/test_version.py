"""``project.version`` in pyproject.toml is the version; every other place agrees with it."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from lxml import etree

ROOT = Path(__file__).parents[2]
OTHERS = (
    "interfaces/pyproject.toml",
    "features/learning/lerobot_robot_robotd/pyproject.toml",
    "plugins/wmx/pyproject.toml",
)


def project(path: str) -> dict[str, Any]:
    found: dict[str, Any] = tomllib.loads((ROOT / path).read_text(encoding="utf-8"))["project"]
    return found


VERSION: str = project("pyproject.toml")["version"]


@pytest.mark.parametrize("path", OTHERS)
def test_distributions_have_this_version(path: str) -> None:
    assert project(path)["version"] == VERSION


@pytest.mark.parametrize("path", ["pyproject.toml", *OTHERS])
def test_pins_between_distributions_have_this_version(path: str) -> None:
    settings = project(path)
    extras = settings.get("optional-dependencies", {}).values()
    requirements = [
        *settings["dependencies"],
        *(requirement for extra in extras for requirement in extra),
    ]
    pins = [
        requirement
        for requirement in requirements
        if re.match(r"robotd(-[a-z0-9]+)?\b", requirement)
    ]
    assert pins == [f"{pin.partition('==')[0]}=={VERSION}" for pin in pins]


def test_the_package_of_ros_has_this_version() -> None:
    assert etree.parse(ROOT / "ros" / "ament" / "package.xml").findtext("version") == VERSION


def test_the_changelog_is_about_this_version() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    [latest] = re.findall(r"^## \[?([^\]\s]+)\]?", text, re.MULTILINE)[:1]
    assert latest in {"Unreleased", VERSION}
