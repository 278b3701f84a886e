"""Launch and parameter files name robots, nodes, arguments and executables that exist."""

from __future__ import annotations

import py_compile
import runpy
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

from robotd.cli.run_command import run
from robotd.descriptor import load_robot_descriptor

AMENT = Path(__file__).parents[2] / "ros" / "ament"
FILES = sorted((AMENT / "launch").glob("*.launch.py"))
REFERENCE = {
    "wmx_ros2_multi_node",
    "wmx_ros2_general_package",
    "wmx_ros2_general_nodes",
    "wmx_ros2_cr3a_manipulator",
    "wmx_ros2_intel_manipulator_cr3a",
    "wmx_ros2_orin_manipulator_cr3a",
    "wmx_ros2_diff_drive_controller",
}
SERVICE_NODES = ("wmx_engine_node", "wmx_core_motion_node", "wmx_io_node", "wmx_ethercat_node")
ARM_NODES = ("manipulator_state", "follow_joint_trajectory_server", *SERVICE_NODES)
# File → robot, variant and nodes that it starts; for the reference's files, what those start.
STARTED = {
    "cr3a": ("cr3a", "intel", None),
    "baymax": ("baymax", None, None),
    "wmx_ros2_multi_node": ("standalone", None, SERVICE_NODES),
    "wmx_ros2_general_package": ("standalone", None, SERVICE_NODES),
    "wmx_ros2_general_nodes": ("standalone", None, SERVICE_NODES),
    "wmx_ros2_cr3a_manipulator": ("cr3a", None, ARM_NODES),
    "wmx_ros2_intel_manipulator_cr3a": ("cr3a", "intel", ARM_NODES[:-1]),
    "wmx_ros2_orin_manipulator_cr3a": ("cr3a", "orin", ARM_NODES[:-1]),
    "wmx_ros2_diff_drive_controller": ("baymax", None, ("diff_drive_controller",)),
}


@dataclass(frozen=True)
class Argument:
    """Stand-in for ``launch.actions.DeclareLaunchArgument``."""

    name: str
    default_value: str
    description: str
    choices: Sequence[str] | None = None


@dataclass(frozen=True)
class Configuration:
    """Stand-in for ``launch.substitutions.LaunchConfiguration``: the value of an argument."""

    name: str


class Process:
    """Stand-in for ``launch_ros.actions.Node``."""

    def __init__(self, **keywords: Any) -> None:
        self.keywords = keywords


@dataclass(frozen=True)
class Later:
    """Stand-in for ``launch.actions.OpaqueFunction``: called when the arguments are known."""

    function: Callable[[Any], Sequence[Process]]


def stand_ins() -> dict[str, ModuleType]:
    """The launch packages, which are not among the ROS wheels, as far as the files use them."""
    contents = {
        "launch": {"LaunchDescription": list},
        "launch.actions": {"DeclareLaunchArgument": Argument, "OpaqueFunction": Later},
        "launch.substitutions": {"LaunchConfiguration": Configuration},
        "launch_ros": {},
        "launch_ros.actions": {"Node": Process},
    }
    modules = {name: ModuleType(name) for name in contents}
    for name, content in contents.items():
        vars(modules[name]).update(content)
    return modules


class LaunchFile:
    """Result of executing a launch file.

    Attributes:
        defaults: argument → its default.
        used: arguments whose values are used.
        node: the keywords of its one Node.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with pytest.MonkeyPatch.context() as patch:
            for name, module in stand_ins().items():
                patch.setitem(sys.modules, name, module)
            patch.delitem(sys.modules, "robot_process", raising=False)
            patch.setattr(sys, "path", [*sys.path])
            described = runpy.run_path(str(path))["generate_launch_description"]()
            sys.modules.pop("robot_process", None)
        arguments = [action for action in described if isinstance(action, Argument)]
        self.defaults = {argument.name: argument.default_value for argument in arguments}
        (process,) = (action for action in described if isinstance(action, Process))
        self.node = process.keywords
        words = self.node["arguments"]
        values = [*words, self.node.get("namespace"), *self.node["parameters"][-1].values()]
        self.used = [value.name for value in values if isinstance(value, Configuration)]

    def words(self) -> list[str]:
        """The command line of the node, every argument at its default."""
        script = (AMENT / "lib" / self.node["executable"]).read_text(encoding="utf-8")
        _exec, _program, *own = shlex.split(script, comments=True)
        words = [word for word in own if word not in ("run", "$@")]
        return [*words, *map(self._word, self.node["arguments"])]

    def config(self) -> Path | None:
        """The parameter file that it names."""
        *files, _own = self.node["parameters"]
        return Path(files[0]) if files else None

    def _word(self, word: str | Configuration) -> str:
        return self.defaults[word.name] if isinstance(word, Configuration) else word


def name_of(path: Path) -> str:
    return path.name.removesuffix(".launch.py")


@pytest.fixture(params=FILES, ids=name_of)
def launch_file(request: pytest.FixtureRequest) -> LaunchFile:
    return LaunchFile(request.param)


def test_the_reference_s_files_are_there() -> None:
    assert {name_of(path) for path in FILES} == REFERENCE | {"cr3a", "baymax"} == set(STARTED)


def test_it_compiles(launch_file: LaunchFile, tmp_path: Path) -> None:
    py_compile.compile(str(launch_file.path), str(tmp_path / "compiled"), doraise=True)


def test_every_argument_is_used_and_every_used_one_declared(launch_file: LaunchFile) -> None:
    assert sorted(launch_file.used) == sorted(launch_file.defaults)
    assert launch_file.defaults["use_sim_time"] == "false"


def test_it_starts_what_its_name_says(launch_file: LaunchFile) -> None:
    robot, variant, nodes = STARTED[name_of(launch_file.path)]
    options = run.make_context("run", launch_file.words()).params
    assert launch_file.node["package"] == "robotd"
    assert (options["robot"], options["variant"]) == (robot, variant)
    assert options["nodes"] is None or set(options["nodes"]) == set(nodes or ())
    descriptor = load_robot_descriptor(robot, variant)
    assert set(nodes or ()) <= set(descriptor.nodes)
    assert options["backend"] == descriptor.backend
    config = launch_file.config()
    assert config is None or config.is_file()


def test_a_fleet_has_a_namespace_for_each_robot() -> None:
    with pytest.MonkeyPatch.context() as patch:
        for name, module in stand_ins().items():
            patch.setitem(sys.modules, name, module)
        file = Path(__file__).parents[2] / "examples" / "fleet" / "fleet.launch.py"
        *arguments, later = runpy.run_path(str(file))["generate_launch_description"]()
        values = {argument.name: argument.default_value for argument in arguments} | {"robots": "3"}
        started = later.function(SimpleNamespace(launch_configurations=values))
    assert [process.keywords["namespace"] for process in started] == ["robot1", "robot2", "robot3"]
    options = run.make_context("run", started[0].keywords["arguments"]).params
    assert (options["robot"], options["backend"]) == ("cr3a", "sim")


def test_launch_loads_it(launch_file: LaunchFile) -> None:
    reason = "the launch packages of ROS are not installed"
    pytest.importorskip("launch_ros", reason=reason)
    sources: Any = pytest.importorskip("launch.launch_description_sources", reason=reason)
    description = sources.get_launch_description_from_python_launch_file(str(launch_file.path))
    declared = {argument.name for argument in description.get_launch_arguments()}
    assert declared == set(launch_file.defaults)


@pytest.mark.parametrize(
    ("name", "robot", "variant"),
    [
        ("intel_manipulator_config_cr3a", "cr3a", "intel"),
        ("orin_manipulator_config_cr3a", "cr3a", "orin"),
        ("diff_drive_controller_config", "baymax", None),
    ],
)
def test_a_parameter_file_says_what_the_robot_says(
    name: str, robot: str, variant: str | None
) -> None:
    text = (AMENT / "config" / f"{name}.yaml").read_text(encoding="utf-8")
    sections = {key: section["ros__parameters"] for key, section in yaml.safe_load(text).items()}
    expected = load_robot_descriptor(robot, variant).ros_parameters
    assert sections == {f"/**/{node}": values for node, values in expected.items()}


def test_the_arm_s_common_file_has_both_mirrors() -> None:
    text = (AMENT / "config" / "cr3a_manipulator_config.yaml").read_text(encoding="utf-8")
    sections = {key: section["ros__parameters"] for key, section in yaml.safe_load(text).items()}
    intel, orin = (load_robot_descriptor("cr3a", name).ros_parameters for name in ("intel", "orin"))
    assert sections == {f"/**/{node}": {**intel[node], **orin[node]} for node in intel}
