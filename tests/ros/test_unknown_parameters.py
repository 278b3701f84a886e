"""Parameters that no node has: rejected at start with the nearest name."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.ros.robot_process import RobotProcess, connected, wait_until

pytestmark = pytest.mark.ros

BASE = ("--nodes", "diff_drive_controller")


@pytest.mark.parametrize(
    ("robot", "parameter", "texts"),
    [
        pytest.param(
            "baymax",
            "linear.x.max_velocty:=0.2",
            ("diff_drive_controller.linear.x.max_velocty", "mean 'linear.x.max_velocity'?"),
            marks=pytest.mark.daily,
        ),
        (
            "cr3a",
            "manipulator_state:joint_feedbak_rate:=100",
            ("manipulator_state.joint_feedbak_rate", "mean 'joint_feedback_rate'?"),
        ),
        ("cr3a", "wmx_io_node:speed:=100", ("wmx_io_node.speed: the node has no such parameter",)),
        ("cr3a", "manipulator_stat:joint_number:=6", ("did you mean 'manipulator_state'?",)),
    ],
)
def test_an_unknown_parameter_ends_the_process_before_anything_opens(
    robot: str, parameter: str, texts: tuple[str, ...]
) -> None:
    with RobotProcess("--ros-args", "-p", parameter, robot=robot) as process:
        assert process.exit_status() == 3
        for text in texts:
            assert text in process.output
        assert "device open" not in process.output


@pytest.mark.parametrize(
    ("parameter", "problem"),
    [
        (
            "joint_feedbak_rate:=100",
            "manipulator_state.joint_feedbak_rate: the node has no such parameter; did you mean",
        ),
        ("foo:=1", "foo: no node has such a parameter"),
    ],
)
def test_an_unknown_parameter_for_all_nodes_is_one_problem(parameter: str, problem: str) -> None:
    with RobotProcess("--ros-args", "-p", parameter) as process:
        assert process.exit_status() == 3
        assert f"robotd: error: {problem}" in process.output
        assert process.output.count("parameter") == 1


@pytest.mark.parametrize("section", ["diff_drive_controller", "/**", "/*/diff_drive_controller"])
def test_a_file_is_checked_like_the_command_line(tmp_path: Path, section: str) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(f'"{section}":\n  ros__parameters:\n    linear.x.max_velocty: 0.2\n')
    arguments = ("--ros-args", "--params-file", str(file))
    namespace = ("-r", "__ns:=/floor") if "*" in section else ()
    with RobotProcess(*BASE, *arguments, *namespace, robot="baymax") as process:
        assert process.exit_status() == 3
        assert "mean 'linear.x.max_velocity'?" in process.output


def test_what_one_node_knows_may_be_given_to_all(tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text("""\
/**:
  ros__parameters:
    use_sim_time: false
    qos_overrides: {/joint_states: {publisher: {depth: 5}}}
    joint_feedback_rate: 50
manipulator_state: {ros__parameters: {joint_number: 6}}
joint_state_broadcaster: {ros__parameters: {joint_axes: [0, 1, 2, 3, 4, 5]}}
a_node_of_another_package: {ros__parameters: {speed: 1.0}}
diff_drive_controller: {ros__parameters: {rate: 100}}
""")
    arguments = ("--params-file", str(file), "-r", "__ns:=/left")
    with RobotProcess("--nodes", "manipulator_state", "--ros-args", *arguments) as process:
        process.wait_ready()
        assert process.end() == 0
        lines = process.output.splitlines()
    warnings = [line for line in lines if "have no effect" in line]
    assert len(warnings) == 2
    assert "the node is /left/manipulator_state; /**/manipulator_state matches" in warnings[0]
    assert "the node is called manipulator_state here" in warnings[1]


@pytest.mark.parametrize(
    ("rule", "text"),
    [
        ("diff_drive_controller:__node:=foo", "nodes keep their names"),
        ("__node:=foo", "in a launch file leave out name="),
        ("robotd:__name:=foo", "nodes keep their names"),
        ("diff_drive_controler:cmd_vel:=x", "did you mean 'diff_drive_controller'?"),
    ],
)
def test_a_rule_that_would_take_a_node_from_its_parameters_is_rejected(
    rule: str, text: str
) -> None:
    with RobotProcess("--ros-args", "-r", rule, robot="baymax") as process:
        assert process.exit_status() == 3
        assert f"{rule}: " in process.output
        assert text in process.output
        assert "missing" not in process.output


def test_the_name_of_a_node_in_a_launch_file_gives_no_other_node_this_name() -> None:
    arguments = ("--ros-args", "-r", "__node:=diff_drive_controller", "-r", "cmd_vel:=drive")
    with RobotProcess(*arguments, robot="baymax") as process:
        process.wait_ready()
        with connected(process) as client:
            names = {"diff_drive_controller", "robotd"}
            wait_until(lambda: names <= set(client.node.get_node_names()), "both nodes")
            assert client.node.get_node_names().count("diff_drive_controller") == 1
            wait_until(lambda: client.node.count_subscribers("/drive") == 1, "the commands")
