"""Launch and parameter files name robots, nodes, arguments and executables that exist."""

from __future__ import annotations

import ast
import py_compile
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from robotd.cli.commands.run import run
from robotd.descriptor import load_robot_descriptor

AMENT = Path(__file__).parents[2] / "ament"
FILES = sorted((AMENT / "launch").glob("*.launch.py"))
REFERENCE = {
    "wmx_ros2_multi_node",
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
    "wmx_ros2_intel_manipulator_cr3a": ("cr3a", "intel", ARM_NODES[:-1]),
    "wmx_ros2_orin_manipulator_cr3a": ("cr3a", "orin", ARM_NODES[:-1]),
    "wmx_ros2_diff_drive_controller": ("baymax", None, ("diff_drive_controller",)),
}


class LaunchFile:
    """What the source of a launch file says, without the launch packages.

    Attributes:
        defaults: argument → its default.
        used: arguments that are asked for.
        node: the keywords of its one Node.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        tree = ast.parse(path.read_text(encoding="utf-8"))
        self._constants = {
            statement.targets[0].id: statement.value
            for statement in tree.body
            if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name)
        }
        calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
        self.defaults = {
            ast.literal_eval(call.args[0]): ast.literal_eval(keywords(call)["default_value"])
            for call in named(calls, "DeclareLaunchArgument")
        }
        self.used = [ast.literal_eval(call.args[0]) for call in named(calls, "LaunchConfiguration")]
        (node,) = named(calls, "Node")
        self.node = keywords(node)

    def words(self) -> list[str]:
        """The command line of the node, every argument at its default."""
        script = (AMENT / "lib" / self.text("executable")).read_text(encoding="utf-8")
        _exec, _program, *own = shlex.split(script, comments=True)
        arguments = self.node["arguments"]
        assert isinstance(arguments, ast.List)
        words = (word for word in own if word not in ("run", "$@"))
        return [*words, *map(self._word, arguments.elts)]

    def text(self, keyword: str) -> str:
        return str(ast.literal_eval(self.node[keyword]))

    def config(self) -> Path | None:
        """The parameter file that it names."""
        found = re.search(r'"config" / "(.+)"', self.path.read_text(encoding="utf-8"))
        return AMENT / "config" / found[1] if found else None

    def _word(self, element: ast.expr) -> str:
        if isinstance(element, ast.Constant):
            return str(element.value)
        if ast.unparse(element) == "','.join(NODES)":
            return ",".join(ast.literal_eval(self._constants["NODES"]))
        assert isinstance(element, ast.Call)
        return str(self.defaults[ast.literal_eval(element.args[0])])


def named(calls: list[ast.Call], name: str) -> Iterator[ast.Call]:
    return (call for call in calls if isinstance(call.func, ast.Name) and call.func.id == name)


def keywords(call: ast.Call) -> dict[str, ast.expr]:
    return {keyword.arg: keyword.value for keyword in call.keywords if keyword.arg}


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
    assert launch_file.text("package") == "robotd"
    assert (options["robot"], options["variant"]) == (robot, variant)
    assert options["nodes"] is None or set(options["nodes"]) == set(nodes or ())
    descriptor = load_robot_descriptor(robot, variant)
    assert set(nodes or ()) <= set(descriptor.nodes)
    assert options["backend"] == descriptor.backend
    config = launch_file.config()
    assert config is None or config.is_file()


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
