"""Robots of an installation whose kinds of bases are not there."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator

import pytest
from click.testing import CliRunner, Result

from robotd.cli import main
from robotd.cli.exit_codes import ExitCode
from robotd.clock.simulated import SteppedClock
from robotd.descriptor import base_kinds, list_robots, load_robot_descriptor
from robotd.device.state import ConnectionState
from robotd.entry_points import Names
from robotd.errors import DescriptorError, PluginError
from robotd.plugin.manager import load_backend
from robotd.robot import Robot


@pytest.fixture(autouse=True)
def _fresh() -> Iterator[None]:
    base_kinds._load.cache_clear()
    yield
    base_kinds._load.cache_clear()


@pytest.fixture
def _without_package(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in [module for module in sys.modules if module.partition(".")[0] == "robotd_bases"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "robotd_bases", None)


def robotd(*words: str) -> Result:
    return CliRunner().invoke(main, words, prog_name="robotd")


@pytest.mark.usefixtures("_without_package")
def test_an_arm_runs_without_kinds_of_bases() -> None:
    robot = Robot(load_robot_descriptor("cr3a"), load_backend("sim"), SteppedClock())
    robot.start(enable=False)
    assert robot.connection.state is ConnectionState.COMMUNICATING
    robot.shutdown()


@pytest.mark.usefixtures("_without_package")
@pytest.mark.parametrize("command", ["run", "check"])
def test_a_base_says_that_its_kind_is_not_there(command: str) -> None:
    result = robotd(command, "--robot", "baymax")
    assert result.exit_code == ExitCode.PLUGIN
    what = r"kind of base 'differential' \(.* of robotd .*\) cannot be imported: ModuleNotFound"
    assert re.search(what, result.output)


@pytest.mark.usefixtures("_without_package")
def test_robots_are_listed_with_what_their_base_lacks() -> None:
    problems = {robot.name: robot.problem for robot in list_robots()}
    assert problems["cr3a"] is None
    assert "kind of base 'mecanum' (" in str(problems["mecanum_base"])


@pytest.mark.usefixtures("_without_package")
def test_an_arm_is_exported_without_kinds_of_bases() -> None:
    assert robotd("export", "moveit", "--robot", "cr3a").exit_code == 0
    assert "has no drive" in robotd("export", "nav2", "--robot", "cr3a").output


def test_kinds_that_nobody_brings_are_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(base_kinds, "installed_names", lambda group: Names({}, {}))
    with pytest.raises(DescriptorError, match=r"unknown kind of base \(available: none\)"):
        load_robot_descriptor("baymax")


def test_a_kind_that_cannot_be_used_is_no_part_of_the_schema() -> None:
    names = {model.__name__ for model in base_kinds.base_models()}
    assert {"DifferentialDrive", "MecanumDrive", "SkidSteerDrive", "TricycleDrive"} <= names
    base_kinds._load.cache_clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(base_kinds, "DriveSettings", int)
        assert [*base_kinds.base_models()] == []
        with pytest.raises(PluginError, match="must be a subclass of DriveSettings"):
            base_kinds.base_kind("mecanum")
