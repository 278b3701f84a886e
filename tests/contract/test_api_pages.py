"""Modules of ``robotd.api``: their names, and the page of each with an example."""

from __future__ import annotations

import re
import subprocess
import sys
from contextlib import AbstractContextManager
from importlib import import_module
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

from robotd import Robot, build_robot, open_robot
from robotd.events import EventKind
from robotd.feature_host import FeatureHost

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = {
    "robotd.api": "reference/plugin-api.md",
    "robotd.api.bases": "how-to/plugin-base.md",
    "robotd.api.commands": "reference/api-commands.md",
    "robotd.api.features": "how-to/plugin-feature.md",
    "robotd.api.models": "reference/api-models.md",
    "robotd.api.robots": "reference/python.md",
}
MAX_MODULES = 6  # a seventh is a decision: readers have to know where to look
LIGHT = ("numpy", "pydantic", "click", "pluggy", "robotd.errors", "robotd.robot")


def text_of(module: str) -> str:
    return (DOCS / PAGES[module]).read_text(encoding="utf-8")


def example_of(module: str) -> dict[str, Any]:
    """Names that the page's first block of Python defines."""
    block = re.search(r"^```python\n(.*?)^```$", text_of(module), re.MULTILINE | re.DOTALL)
    assert block, module
    names: dict[str, Any] = {"__name__": "example"}
    exec(compile(block[1], PAGES[module], "exec"), names)
    return names


def test_each_attribute_of_a_robot_is_sorted_by_subject() -> None:
    table = text_of("robotd.api.robots").split("\n## Robot\n")[1].split("```")[0]
    robot = build_robot("cr3a", "sim")
    attributes = {*vars(robot), *vars(Robot)}
    assert sorted(re.findall(r"`(\w+)`", table)) == sorted(
        name for name in attributes if not name.startswith("_")
    )


def test_each_module_has_a_page() -> None:
    files = (ROOT / "core" / "robotd" / "api").glob("*.py")
    modules = {f"robotd.api.{path.stem}".removesuffix(".__init__") for path in files}
    assert modules == PAGES.keys()
    assert len(modules) <= MAX_MODULES


@pytest.mark.parametrize("module", PAGES)
def test_all_names_are_sorted_and_can_be_imported(module: str) -> None:
    api = import_module(module)
    names: list[str] = api.__all__

    def order(name: str) -> tuple[int, str]:
        return (0 if name.isupper() else 1 if name[0].isupper() else 2), name

    assert names == sorted(set(names), key=order)
    for name in names:
        assert getattr(api, name) is not None
    assert set(names) <= {*dir(api)}
    with pytest.raises(AttributeError, match=f"module '{module}' has no attribute 'nonsense'"):
        _ = api.nonsense


@pytest.mark.parametrize("module", PAGES)
def test_the_page_lists_each_name(module: str) -> None:
    text = text_of(module)
    table = text.partition("## Names\n\n")[2].partition("\n\n")[0]
    # The second column: the first may name a command.
    listed = [name for row in table.splitlines() for name in names_in(row)]
    assert sorted(listed) == sorted(import_module(module).__all__)


def names_in(row: str) -> list[str]:
    return re.findall(r"`(\w+)`", row.strip("|").partition("|")[2])


def test_what_others_copy_imports_nothing_deeper() -> None:
    """Examples, templates of packages, and the code on the pages."""
    deeper = re.compile(r"^\s*(?:from|import) (robotd\.(?!api\b)\w+)", re.MULTILINE)
    files = [
        *(path for path in (ROOT / "examples").rglob("*.py") if "build" not in path.parts),
        *(ROOT / "features").rglob("*.in"),
        *(path for path in (ROOT / "docs").rglob("*.md") if "decisions" not in path.parts),
        ROOT / "README.md",
    ]
    found = {path.name: deeper.findall(path.read_text(encoding="utf-8")) for path in files}
    assert len(files) > 100
    assert {name: modules for name, modules in found.items() if modules} == {}


def test_importing_the_modules_imports_nothing_else() -> None:
    code = f"import sys, {', '.join(PAGES)}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(LIGHT) & set(done.stdout.split()) == {"robotd.errors"}  # of robotd itself


def test_the_example_of_a_backend_has_nodes() -> None:
    assert callable(example_of("robotd.api")["robotd_register_nodes"])


def test_the_example_of_a_base_is_a_section() -> None:
    fields = example_of("robotd.api.bases")["TrackDrive"].model_fields
    assert {"kind", "left_axis", "right_axis", "wheel_radius_m"} <= fields.keys()


def test_the_example_of_a_command_lists_the_joints() -> None:
    command: click.Command = example_of("robotd.api.commands")["joints"]
    result = CliRunner().invoke(command, ["--robot", "cr3a"])
    assert result.output.splitlines()[0].split() == ["joint1", "rad"]


def test_the_example_of_a_feature_shows_the_events() -> None:
    shown: list[str] = []
    example = example_of("robotd.api.features")
    with open_robot("cr3a", "sim") as robot:
        host = FeatureHost(robot, (), "/", shown.append)
        keys = example["EchoKeys"](echo=True)
        robot.descriptor._settings[example["EchoKeys"]] = keys
        part: AbstractContextManager[None] = example["open_echo"](host)
        with part:
            robot.events.add(EventKind.LOG, "test", "hello")
            host.tap().observe()
    assert "hello" in shown


def test_the_example_of_files_prints_joints_and_tool(capsys: pytest.CaptureFixture[str]) -> None:
    example_of("robotd.api.models")
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[0] == "joint1"
    assert lines[-1].startswith("[")


def test_the_example_of_a_program_reaches_its_goal(capsys: pytest.CaptureFixture[str]) -> None:
    example_of("robotd.api.robots")
    assert "goal reached" in capsys.readouterr().out.splitlines()[0]
