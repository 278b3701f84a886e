"""pyproject.toml lists packages one by one: nothing in the folders may be missing from it."""

import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
ROBOTD: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
INTERFACES: dict[str, Any] = tomllib.loads(
    (ROOT / "interfaces" / "pyproject.toml").read_text(encoding="utf-8")
)
PACKAGE_DIRS: dict[str, str] = ROBOTD["tool"]["setuptools"]["package-dir"]


def packages_in_folders() -> set[str]:
    return {
        ".".join((package, *init.parent.relative_to(ROOT / folder).parts))
        for package, folder in PACKAGE_DIRS.items()
        for init in (ROOT / folder).rglob("__init__.py")
    }


def test_every_package_is_listed() -> None:
    assert packages_in_folders() == set(ROBOTD["tool"]["setuptools"]["packages"])


def test_every_robot_file_is_package_data() -> None:
    patterns: list[str] = ROBOTD["tool"]["setuptools"]["package-data"]["robotd_robots"]
    robots = ROOT / PACKAGE_DIRS["robotd_robots"]
    shipped = {path for pattern in patterns for path in robots.glob(pattern)}
    files = {
        path for path in robots.rglob("*") if path.is_file() and "__pycache__" not in path.parts
    }
    assert {path.name for path in files - shipped} == {"__init__.py"}


def test_ros_packages_are_pinned_alike() -> None:
    def pins(requirements: list[str]) -> dict[str, str]:
        pairs = (item.split("==") for item in requirements if "==" in item)
        return {name: version for name, version in pairs if name.startswith("ros-jazzy-")}

    extra = pins(ROBOTD["project"]["optional-dependencies"]["ros"])
    for requirements in (
        INTERFACES["project"]["dependencies"],
        INTERFACES["build-system"]["requires"],
    ):
        shared = pins(requirements)
        assert {name: extra.get(name, version) for name, version in shared.items()} == shared


def test_the_extra_names_this_version_of_the_interfaces() -> None:
    version = INTERFACES["project"]["version"]
    extra: list[str] = ROBOTD["project"]["optional-dependencies"]["ros"]
    assert f"robotd-interfaces=={version}" in extra
