"""``robotd robots``, ``backends`` and ``nodes``, for people and for programs."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from robotd.plugin.manager import PLUGINS

Robotd = Callable[..., Result]
Install = Callable[..., Path]

BROKEN_ROBOT = "schema: 1\nname: broken\naxes: 1\nspeed: 3\n"


def rows(result: Result) -> dict[str, dict[str, Any]]:
    assert result.exit_code == 0, result.output
    return {row["name"]: row for row in json.loads(result.stdout)}


@pytest.fixture
def robots_of_a_plugin(install: Install, tmp_path: Path) -> Path:
    """A plugin that brings one node, and a folder with one broken robot."""
    folder = tmp_path / "robots"
    (folder / "broken").mkdir(parents=True)
    (folder / "broken" / "robot.yaml").write_text(BROKEN_ROBOT, encoding="utf-8")
    source = f"""
        from pathlib import Path
        from robotd.api import hookimpl

        @hookimpl
        def robotd_register_robots(registry):
            registry.add_folder(Path({str(folder)!r}))

        @hookimpl
        def robotd_register_nodes(registry):
            registry.add("lights", "acme.lights:Lights")
    """
    install("more", source, group=PLUGINS)
    return folder


def test_robots_are_listed_with_their_variants_the_default_first(robotd: Robotd) -> None:
    cr3a = rows(robotd("robots", "--json"))["cr3a"]
    simulated = ["canopen_simulated", "canopen_multicast", "ethercat_simulated"]
    assert cr3a["variants"] == ["intel", "orin", *simulated]
    assert cr3a["problem"] is None
    assert Path(cr3a["path"]).is_file()
    text = robotd("robots").stdout
    assert "cr3a  Dobot CR3A" in text
    assert "intel, orin" in text


def test_a_plugins_robot_is_listed_and_told_broken(
    robotd: Robotd, robots_of_a_plugin: Path
) -> None:
    broken = rows(robotd("robots", "--json"))["broken"]
    assert broken["path"] == str(robots_of_a_plugin / "broken" / "robot.yaml")
    assert "4: speed: unknown key" in broken["problem"]
    result = robotd("robots")
    assert result.exit_code == 0
    assert "unusable" in result.stdout
    assert "speed: unknown key" in result.stdout


def test_backends_are_listed_with_origin_and_capabilities(robotd: Robotd) -> None:
    sim = rows(robotd("backends", "--json"))["sim"]
    assert sim["distribution"] == "robotd"
    assert sim["api_version"] == 1
    assert {"axes", "io", "fieldbus"} <= set(sim["capabilities"])
    assert sim["problem"] is None
    assert "simulated" in robotd("backends").stdout


def test_a_backend_that_cannot_load_is_listed_with_the_reason(
    robotd: Robotd, install: Install
) -> None:
    install("heavy", "import not_there_at_all", distribution="heavy", version="3.1")
    listed = rows(robotd("backends", "--json"))
    assert listed["sim"]["problem"] is None
    heavy = listed["heavy"]
    assert (heavy["distribution"], heavy["version"]) == ("heavy", "3.1")
    assert heavy["api_version"] is None
    assert "No module named 'not_there_at_all'" in heavy["problem"]
    assert "not_there_at_all" in robotd("backends").stdout


def test_both_of_two_backends_with_one_name_are_listed(robotd: Robotd, install: Install) -> None:
    install("twin", distribution="one")
    install("twin", distribution="two")
    result = robotd("backends", "--json")
    twins = [row for row in json.loads(result.stdout) if row["name"] == "twin"]
    assert [row["distribution"] for row in twins] == ["one", "two"]
    assert all("the name 'twin' is taken by" in row["problem"] for row in twins)


def test_a_backend_that_logs_while_it_loads_does_not_spoil_the_json(
    robotd: Robotd, install: Install
) -> None:
    source = """
        from robotd.api import BackendInfo, get_logger, hookimpl

        get_logger("noisy").warning("loading")

        @hookimpl
        def robotd_backend():
            return BackendInfo(summary="", api_version=1)
    """
    install("noisy", source, distribution="noisy")
    result = robotd("backends", "--json")
    assert rows(result)["noisy"]["problem"] is None
    assert "loading" in result.stderr


def test_nodes_are_listed_those_of_plugins_too(robotd: Robotd, robots_of_a_plugin: Path) -> None:
    listed = rows(robotd("nodes", "--json"))
    assert listed["lights"]["factory"] == "acme.lights:Lights"
    assert [*listed][-1] == "lights"  # those of robotd come first
    assert {"wmx_engine_node", "manipulator_state"} <= set(listed)
    assert all(row["summary"] for row in listed.values())
    assert "wmx_io_node" in robotd("nodes").stdout


def test_a_broken_plugin_is_a_warning(robotd: Robotd, install: Install) -> None:
    install("bad", "1 / 0", distribution="bad", group=PLUGINS)
    for command in ("robots", "nodes"):
        result = robotd(command)
        assert result.exit_code == 0
        assert "robotd: warning: plugin 'bad' (plugin_bad of bad 1.2)" in result.stderr
        assert result.stdout


def test_a_plugin_with_the_name_of_a_built_in_node_is_rejected(
    robotd: Robotd, install: Install
) -> None:
    source = """
        from robotd.api import hookimpl

        @hookimpl
        def robotd_register_nodes(registry):
            registry.add("wmx_io_node", "acme.io:Io")
    """
    install("thief", source, group=PLUGINS)
    result = robotd("nodes")
    assert result.exit_code == 0
    assert "plugin 'thief' (plugin_acme of acme 1.2): node 'wmx_io_node' is taken" in result.stderr
    assert "acme.io:Io" not in robotd("nodes", "--json").stdout
