"""Features as a user, an author and a robot without one of them meet them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import tomllib
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from tests.installed_plugin import Install

from robotd import feature_host
from robotd.cli import main
from robotd.cli.exit_codes import ExitCode
from robotd.cli.run_command import RunCommand, feature_overrides, run
from robotd.clock.simulated import SteppedClock
from robotd.descriptor import Override, load_robot_descriptor, override, parse_override
from robotd.device.state import ConnectionState
from robotd.errors import DescriptorError, PluginError
from robotd.feature import RUN_OPTIONS, _loaded, feature_failures, installed_features
from robotd.feature_host import open_features
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

EXAMPLE = Path(__file__).parents[2] / "examples" / "csv_feature"
FEATURES = Path(__file__).parents[2] / "features"
FOLDERS = sorted(path.name for path in FEATURES.iterdir() if (path / "README.md").is_file())
OPTIONS = {
    "foxglove": "--foxglove=0",
    "metrics": "--metrics=0",
    "page": "--page=0",
    "recorder": "--record=folder",
    "scenario": "--scenario=file",
    "service": "--health=0",
}


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Iterator[str]:
    """Name of a folder of features whose packages are not there."""
    name: str = request.param
    packages = packages_of(name)
    for module in [module for module in sys.modules if module.partition(".")[0] in packages]:
        monkeypatch.delitem(sys.modules, module)
    for package in packages:
        monkeypatch.setitem(sys.modules, package, None)
    _loaded.cache_clear()
    yield name
    _loaded.cache_clear()


def packages_of(folder: str) -> set[str]:
    return {path.parent.name for path in (FEATURES / folder).glob("*/__init__.py")}


def commands_of(folder: str) -> list[str]:
    packages = packages_of(folder)
    entries = entry_points(group="robotd.commands")
    return sorted(entry.name for entry in entries if entry.module.partition(".")[0] in packages)


def test_each_folder_of_features_is_taken_away_once() -> None:
    project = tomllib.loads((FEATURES.parent / "pyproject.toml").read_text(encoding="utf-8"))
    folders: dict[str, str] = project["tool"]["setuptools"]["package-dir"]
    assert {
        folder.split("/")[1] for folder in folders.values() if folder.startswith("features/")
    } == {*FOLDERS}


@pytest.mark.parametrize("without", FOLDERS, indirect=True)
def test_a_robot_runs_without_a_feature(without: str, tmp_path: Path) -> None:
    folder = parse_override(f"recorder.folder={tmp_path}")
    overrides = [] if without == "recorder" else [folder]
    descriptor = load_robot_descriptor("cr3a", overrides=overrides)
    robot = Robot(descriptor, load_backend("sim"), SteppedClock())
    with open_features(robot) as features:
        assert without not in features.parts
        assert features.parts or without == "recorder"
        robot.start(enable=False)
        assert robot.connection.state is ConnectionState.COMMUNICATING
        robot.shutdown()


@pytest.mark.parametrize("without", FOLDERS, indirect=True)
def test_its_commands_say_that_it_is_not_there(without: str) -> None:
    assert CliRunner().invoke(main, ["--help"], prog_name="robotd").exit_code == 0
    for name in commands_of(without):
        result = CliRunner().invoke(main, [name, "--help"], prog_name="robotd")
        assert result.exit_code == ExitCode.PLUGIN
        assert f"command {name!r} (" in result.output
        assert "cannot be imported: ModuleNotFoundError" in result.output


@pytest.mark.parametrize("without", OPTIONS, indirect=True)
def test_its_option_says_that_it_is_not_there(without: str) -> None:
    option = OPTIONS[without]
    result = CliRunner().invoke(main, ["--robot", "cr3a", option], prog_name="robotd")
    assert result.exit_code == 2
    assert f"No such option '{option.partition('=')[0]}'" in result.output
    assert f"feature {without!r} (" in result.output
    assert "cannot be imported: ModuleNotFoundError" in result.output


def test_faults_on_request_are_offered_by_scenarios_only() -> None:
    robot = Robot(load_robot_descriptor("cr3a"), load_backend("sim"), SteppedClock())
    with open_features(robot) as features:
        faults = features.offered["faults"]()
        assert "amp_alarm" in faults.fields
        assert faults.inject({"amp_alarm": {"axis": 2}}).startswith("amp_alarm axis=2")
        with pytest.raises(DescriptorError, match="amp_alarm"):
            faults.inject({"amp_alarn": {"axis": 2}})
        robot.shutdown()


def test_the_recorder_comes_before_those_that_use_it() -> None:
    order = [*installed_features()]
    assert order.index("recorder") < order.index("page") < order.index("metrics")


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment in which the example's feature is installed."""
    site = tmp_path_factory.mktemp("site")
    pip = (sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    arguments = ("--no-deps", "--no-build-isolation", "--target", str(site), str(EXAMPLE))
    subprocess.run([*pip, *arguments], check=True)
    return os.environ | {"PYTHONPATH": str(site)}


@pytest.mark.long
def test_a_third_party_feature_is_listed_checked_and_offered(
    installed: dict[str, str], tmp_path: Path
) -> None:
    def robotd(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "robotd", *words]
        return subprocess.run(
            command, env=installed, cwd=tmp_path, capture_output=True, text=True, check=False
        )

    listed = robotd("features")
    assert listed.returncode == 0
    assert "joint positions as CSV" in listed.stdout
    assert "last seconds of everything" in listed.stdout
    assert "--csv FILE" in robotd("run", "--help").stdout
    file = tmp_path / "robot.yaml"
    file.write_text("extends: cr3a\nname: cr3b\ncsv:\n  rate_hz: -1.0\n", encoding="utf-8")
    wrong = robotd("check", "--robot", str(file))
    assert wrong.returncode == 3
    assert f"{file}:4: csv.rate_hz: must be greater than 0 (value -1.0)" in wrong.stdout
    file.write_text("extends: cr3a\nname: cr3b\ncsv:\n  rate: 1.0\n", encoding="utf-8")
    unknown = robotd("check", "--robot", str(file))
    assert "csv.rate: unknown key; did you mean" in unknown.stdout


@pytest.mark.long
def test_a_third_party_feature_runs_beside_the_robot(
    installed: dict[str, str], tmp_path: Path
) -> None:
    program = """
from robotd.clock import MonotonicClock
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.device.state import ConnectionState
from robotd.errors import DescriptorError, PluginError
from robotd.feature_host import open_features
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
import time
values = [parse_override("csv.file=out.csv"), parse_override("recorder.enabled=false")]
descriptor = load_robot_descriptor("cr3a", overrides=values)
robot = Robot(descriptor, load_backend("sim"), MonotonicClock())
with open_features(robot) as features:
    robot.start(enable=False)
    until_s = time.monotonic() + 20.0
    while len(open("out.csv").readlines()) < 4 and time.monotonic() < until_s:
        time.sleep(0.05)
    robot.shutdown()
"""
    subprocess.run([sys.executable, "-c", program], env=installed, cwd=tmp_path, check=True)
    header, *rows = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    assert header == "time_s,joint1,joint2,joint3,joint4,joint5,joint6"
    assert len(rows) >= 3
    assert all(len(row.split(",")) == 7 for row in rows)


@pytest.mark.parametrize(
    ("arguments", "port"),
    [([], 8080), (["--page-control"], 8080), (["0"], 0), (["81", "--page-control"], 81)],
)
def test_a_page_without_a_port_has_its_own_one(arguments: list[str], port: int) -> None:
    found = list[Override]()

    @click.command(cls=RunCommand)
    def command() -> None:
        found.extend(feature_overrides())

    CliRunner().invoke(command, ["--page", *arguments], catch_exceptions=False)
    assert found[0] == override("page", port)
    assert len(found) == 1 + ("--page-control" in arguments)


def test_a_third_party_feature_takes_no_key_and_is_named_with_the_line_that_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = tmp_path / "echo-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: echo\nVersion: 1\n")
    (info / "entry_points.txt").write_text(
        "[robotd.features]\naaa = plugin_echo:THIEF\necho = plugin_echo:FEATURE\n"
    )
    (tmp_path / "plugin_echo.py").write_text(
        "from robotd.api.features import Feature, Section\n"
        "class Thief(Section):\n    page: bool = False\n"
        "THIEF = Feature('takes', settings=Thief, open='plugin_echo:open_echo')\n"
        "class Echo(Section):\n    echo: bool = False\n"
        "FEATURE = Feature('fails', settings=Echo, open='plugin_echo:open_echo')\n"
        "def open_echo(host):\n    raise OSError(5, 'no port')\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    [refused] = feature_failures().values()
    assert re.fullmatch(
        r"feature 'aaa' \(plugin_echo:THIEF of echo 1\): its key 'page' is taken by"
        r" 'page' \(robotd_page.feature:FEATURE of robotd .*\)",
        refused,
    )
    without = Robot(load_robot_descriptor("cr3a"), load_backend("sim"), SteppedClock())
    with open_features(without) as host:
        assert "echo" not in host.parts
    asked = load_robot_descriptor("cr3a", overrides=[parse_override("echo=true")])
    robot = Robot(asked, load_backend("sim"), SteppedClock())
    failure = (
        r"feature 'echo' \(plugin_echo:FEATURE of echo 1\): open \(plugin_echo:open_echo\) failed:"
        r" OSError: .* no port \(plugin_echo.py:9\)"
    )
    with pytest.raises(PluginError, match=failure), open_features(robot):
        pass


def test_all_options_of_a_run_are_known_to_belong_to_robotd() -> None:
    context = click.Context(run, info_name="run")
    own = {word for parameter in click.Command.get_params(run, context) for word in parameter.opts}
    words = {flag for flag in own if flag.startswith("--")} | {"--ros-args", "--version"}
    assert words == {*RUN_OPTIONS}


def test_a_feature_that_takes_long_to_open_is_named(
    install: Install, monkeypatch: pytest.MonkeyPatch
) -> None:
    warned = threading.Event()
    monkeypatch.setattr(feature_host, "SLOW_OPEN_S", 0.0)
    monkeypatch.setattr(feature_host.log, "warning", lambda *_, **found: texts(found))
    named: list[str] = []

    def texts(found: dict[str, str]) -> None:
        named.append(found["feature"])
        if "plugin_acme" in found["feature"]:
            warned.set()

    source = """
        from contextlib import contextmanager
        from robotd.api.features import Feature, Section

        class Keys(Section):
            slow: bool = False

        wait = []

        @contextmanager
        def open_slow(host):
            yield wait[0](20.0)

        FEATURE = Feature("slow", settings=Keys, open="plugin_acme:open_slow")
    """
    site = install("slow", source, group="robotd.features")
    entries = next(site.glob("*.dist-info")) / "entry_points.txt"
    entries.write_text("[robotd.features]\nslow = plugin_acme:FEATURE\n", encoding="utf-8")
    robot = Robot(load_robot_descriptor("cr3a"), load_backend("sim"), SteppedClock())
    sys.modules["plugin_acme"].wait.append(warned.wait)
    with open_features(robot) as host:
        assert host.parts["slow"] is True
    assert "'slow' (plugin_acme:FEATURE of acme 1.2)" in named
