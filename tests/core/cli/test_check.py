"""``robotd check`` finds what is wrong, says all of it, and touches nothing."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import robotd_robots
import yaml
from click.testing import Result

from robotd.cli.exit_codes import ExitCode
from robotd.errors import Unsupported
from robotd.plugin.manager import PLUGINS
from robotd.robot import build_robot

Robotd = Callable[..., Result]
Install = Callable[..., Path]
Edit = Callable[[str, str, str], Path]

INSTALLED = Path(next(iter(robotd_robots.__path__)))
ROBOTS = sorted(path.parent.name for path in INSTALLED.glob("*/robot.yaml"))


@pytest.fixture
def cr3a(tmp_path: Path) -> Path:
    """A copy of the CR3A's folder."""
    return Path(shutil.copytree(INSTALLED / "cr3a", tmp_path / "cr3a"))


@pytest.fixture
def edit(cr3a: Path) -> Edit:
    """``edit(file, old, new)`` in the copy; returns the robot.yaml."""

    def change(file: str, old: str, new: str) -> Path:
        path = cr3a / file
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")
        return cr3a / "robot.yaml"

    return change


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_robots_that_come_with_robotd_are_well(robotd: Robotd, robot: str) -> None:
    result = robotd("check", "--robot", robot)
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[-1] == "all checks passed"
    assert "fail" not in result.stdout


@pytest.mark.parametrize("variant", ["intel", "orin"])
def test_a_variant_can_be_checked(robotd: Robotd, variant: str) -> None:
    assert robotd("check", "--robot", "cr3a", "--variant", variant).exit_code == 0


def test_every_problem_is_told_and_counted(robotd: Robotd, edit: Edit) -> None:
    edit("robot.yaml", "wmx_io_node", "wmx_oi_node")
    edit("cr3a.urdf", 'name="joint3"', 'name="joint_three"')
    path = edit("robot.yaml", "upper_rad: 6.28", "upper_rad: 7.28")
    result = robotd("check", "--robot", str(path), "--backend", "nope")
    assert result.exit_code == ExitCode.CONFIGURATION
    for text in ("wmx_oi_node", "has no joint 'joint3'", "upper limit 6.28", "'nope'"):
        assert text in result.stdout
    assert "did you mean 'wmx_io_node'?" in result.stdout
    assert result.stdout.splitlines()[-1] == "4 problems"


def test_a_broken_descriptor_does_not_hide_a_broken_backend(robotd: Robotd, edit: Edit) -> None:
    path = edit("robot.yaml", "summary:", "sumary:")
    result = robotd("check", "--robot", str(path), "--backend", "nope")
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "did you mean 'summary'?" in result.stdout
    assert "unknown backend 'nope'" in result.stdout


def test_options_of_the_backend_are_checked(robotd: Robotd, tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    text = "schema: 1\nname: bare\naxes: 1\nbackend: sim\nbackends:\n  sim: {nonsense: 1}\n"
    path.write_text(text, encoding="utf-8")
    result = robotd("check", "--robot", str(path))
    assert result.exit_code == ExitCode.CONFIGURATION
    assert f"{path}:6: backends.sim.nonsense: unknown key" in result.stdout


BARE = """
    from robotd.api import *
    from tests.fakes import FakeAxes, FakeDevice

    class Axes(FakeAxes):
        device_limits = ()
        feedback_period_s = 0.0

    @hookimpl
    def robotd_backend():
        return BackendInfo("a test", 1)

    @hookimpl
    def robotd_open_device():
        return FakeDevice()

    @hookimpl
    def robotd_axes(device, context):
        return Axes(context.robot.axes)
"""


def test_a_smaller_limit_of_the_device_is_mentioned(robotd: Robotd, install: Install) -> None:
    limits = "(AxisLimits(-1.0, 9.0, 2.0, 99.0),) * 6"
    install("bare", BARE.replace("device_limits = ()", f"device_limits = {limits}"))
    result = robotd("check", "--robot", "cr3a", "--set", "gripper=null", "--backend", "bare")
    assert (
        "joint1: lower limit -3.14 rad exceeds the device's -1 rad, which applies" in result.stdout
    )
    assert (
        "joint6: velocity 3.14 rad/s exceeds the device's 2 rad/s, which applies" in result.stdout
    )
    assert "upper limit" not in result.stdout
    assert "fail  limits" not in result.stdout


def test_feedback_slower_than_the_robot_waits_is_a_fault(robotd: Robotd, install: Install) -> None:
    install("bare", BARE.replace("feedback_period_s = 0.0", "feedback_period_s = 0.06"))
    result = robotd("check", "--robot", "cr3a", "--backend", "bare")
    assert result.exit_code == ExitCode.CONFIGURATION
    text = "engine.stale_after_s: 0.1 s is too short: new values of the bare backend come every"
    assert f"{text} 0.06 s; set it to 0.12 s or more" in result.stdout


def test_what_options_know_of_the_robot_is_checked(
    robotd: Robotd, install: Install, tmp_path: Path
) -> None:
    source = """
        from robotd.api import BackendInfo, BackendOptions, DescriptorError, hookimpl

        class Options(BackendOptions):
            def check_robot(self, robot):
                raise DescriptorError(f"no drive for {robot.axes} axes", key="backends.acme")

        @hookimpl
        def robotd_backend():
            return BackendInfo("a test", 1, options=Options)
    """
    install("acme", source)
    path = tmp_path / "robot.yaml"
    path.write_text("schema: 1\nname: bare\naxes: 3\n", encoding="utf-8")
    result = robotd("check", "--robot", str(path), "--backend", "acme")
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "backends.acme: no drive for 3 axes" in result.stdout


def test_joint_groups_need_streamed_setpoints(
    robotd: Robotd, install: Install, tmp_path: Path
) -> None:
    source = """
        from robotd.api import *
        from tests.fakes import FakeAxes, FakeDevice

        @hookimpl
        def robotd_backend():
            return BackendInfo("a test", 1, frozenset({Capability.TRAJECTORIES_ON_DEVICE}))

        @hookimpl
        def robotd_open_device():
            return FakeDevice()

        @hookimpl
        def robotd_axes(device):
            return FakeAxes(12)
    """
    install("acme", source)
    path = tmp_path / "robot.yaml"
    path.write_text("schema: 1\nname: arms\nextends: dual_cr3a\n", encoding="utf-8")
    result = robotd("check", "--robot", str(path), "--backend", "acme")
    assert result.exit_code == ExitCode.CONFIGURATION
    text = "several joint groups with trajectories that the device interpolates: not supported"
    assert f"groups: {text} by the acme backend" in result.stdout
    with pytest.raises(Unsupported, match=text):
        build_robot(path, "acme")
    assert robotd("check", "--robot", "cr5a", "--backend", "acme").exit_code == ExitCode.OK


def test_the_parameter_file_is_checked(robotd: Robotd, edit: Edit) -> None:
    path = edit("wmx_parameters.xml", "<AxisPolarity>-1<", "<AxisPolarity>-3<")
    result = robotd("check", "--robot", str(path))
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "AxisPolarity" in result.stdout
    assert "-3" in result.stdout


def test_a_quick_stop_far_beyond_the_limits_is_a_warning(robotd: Robotd, edit: Edit) -> None:
    path = edit("wmx_parameters.xml", "<QuickStopDec>100000.000000<", "<QuickStopDec>20.0<")
    result = robotd("check", "--robot", str(path))
    assert result.exit_code == ExitCode.OK
    [line] = [line for line in result.stdout.splitlines() if "QuickStopDec" in line]
    assert line.startswith("warn  joint2, joint3, joint4, joint5, joint6: QuickStopDec of 100000")
    assert line.endswith("twice the joint's acceleration limit: 25.1 rad/s²")


def test_axes_that_the_parameter_file_lacks_are_named(robotd: Robotd, edit: Edit) -> None:
    path = edit("wmx_parameters.xml", '<AxisParameters Axis="4">', '<AxisParameters Axis="44">')
    xml = path.with_name("wmx_parameters.xml")
    text = xml.read_text(encoding="utf-8")
    start = text.index('<AxisParameters Axis="44">')
    end = text.index("</AxisParameters>", start) + len("</AxisParameters>")
    xml.write_text(text[:start] + text[end:], encoding="utf-8")
    result = robotd("check", "--robot", str(path))
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "nothing is stated for axis 4 of a robot with 6 axes" in result.stdout


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('name="joint1" type="revolute"', 'name="joint1" type="fixed"', "is 'fixed', not"),
        ('lower="-2.86"', 'lower="-2.5"', "lower limit -2.5 is exceeded by lower_rad -2.86"),
        ('name="picker_1_joint"', 'name="finger"', "has no joint 'picker_1_joint'"),
        ("</robot>", "", "not XML"),
    ],
)
def test_the_urdf_is_compared(robotd: Robotd, edit: Edit, old: str, new: str, text: str) -> None:
    result = robotd("check", "--robot", str(edit("cr3a.urdf", old, new)))
    assert result.exit_code == ExitCode.CONFIGURATION
    assert text in result.stdout
    assert result.stdout.splitlines()[-1] == "1 problem"


@pytest.mark.parametrize(
    ("robot", "key", "text"),
    [
        ("cr3a", "tool_link=link7", "has no link 'link7', tool_link; did you mean 'link"),
        ("dual_cr3a", "groups.left.tool_link=hand", "has no link 'hand', tool_link"),
        ("dual_cr3a", "tool_link=left_link6", "tool_link: belongs into a group (left, right)"),
        ("baymax", "drive.wheel_joints=[left_wheel_joint, right]", "has no joint 'right'"),
    ],
)
def test_links_and_joints_of_the_urdf_exist(
    robotd: Robotd, tmp_path: Path, robot: str, key: str, text: str
) -> None:
    path, _, value = key.partition("=")
    content: Any = yaml.safe_load(value)
    for name in reversed(path.split(".")):
        content = {name: content}
    file = tmp_path / "robot.yaml"
    file.write_text(yaml.safe_dump({"schema": 1, "name": "mine", "extends": robot} | content))
    result = robotd("check", "--robot", str(file))
    assert result.exit_code == ExitCode.CONFIGURATION
    assert text in result.stdout


def test_a_robot_may_stay_within_the_urdfs_limits(robotd: Robotd, edit: Edit) -> None:
    path = edit("robot.yaml", "upper_rad: 6.28", "upper_rad: 1.0")
    assert robotd("check", "--robot", str(path)).exit_code == 0


def test_a_backend_without_outputs_cannot_drive_a_gripper(robotd: Robotd, install: Install) -> None:
    install("bare", BARE)
    result = robotd("check", "--robot", "cr3a", "--backend", "bare")
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "gripper: needs digital outputs, which the bare backend does not have" in result.stdout


def test_a_parameter_file_that_a_backend_ignores_is_mentioned(
    robotd: Robotd, install: Install, edit: Edit
) -> None:
    install("bare", BARE)
    edit("robot.yaml", "    wmx_gripper_topic: wmx/set_gripper\n", "")
    path = edit("robot.yaml", "default_variant: intel", "gripper: null\ndefault_variant: intel")
    text = path.read_text(encoding="utf-8")
    start, end = text.index("gripper:\n"), text.index("trajectory:")
    path.write_text(text[:start] + text[end:], encoding="utf-8")
    result = robotd("check", "--robot", str(path), "--backend", "bare")
    assert result.exit_code == 0, result.stdout
    assert "parameters_file is not used by this backend" in result.stdout


def test_a_broken_plugin_is_a_warning_as_for_a_run(robotd: Robotd, install: Install) -> None:
    install("bad", "1 / 0", distribution="bad", group=PLUGINS)
    result = robotd("check", "--robot", "cr3a")
    assert result.exit_code == ExitCode.OK
    text = "plugin 'bad' (plugin_bad of bad 1.2) cannot be imported: ZeroDivisionError"
    assert f"warn  {text}" in result.stdout


def test_no_ros_is_needed() -> None:
    program = (
        "import sys\n"
        "sys.modules['rclpy'] = None\n"
        "from robotd.cli import main\n"
        "main(['check', '--robot', 'cr3a'])"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], check=False, capture_output=True, text=True, timeout=50
    )
    assert (result.returncode, result.stderr) == (0, "")


def test_a_value_of_the_command_line_is_checked_like_the_file(robotd: Robotd) -> None:
    result = robotd("check", "--robot", "cr3a", "--set", "backends.sim.sed=7")
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "--set: backends.sim.sed: unknown key; did you mean 'seed'?" in result.output


def test_a_value_for_a_backend_that_is_not_in_use_is_rejected(robotd: Robotd) -> None:
    result = robotd("check", "--robot", "cr3a", "--set", "backends.canopen.sdo_timeout_s=1")
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "--set: backends.canopen.sdo_timeout_s: the backend in use is 'sim'" in result.output


LIGHTS = """
    from robotd.api import hookimpl

    @hookimpl
    def robotd_register_nodes(registry):
        registry.add("lights", "no_ros_here:Lights", parameters=__name__ + ":read_lights")

    def read_lights(reader, descriptor):
        {read}
"""


def test_wrong_parameters_of_a_plugins_node_are_reported_with_file_and_line(
    robotd: Robotd, edit: Edit, install: Install
) -> None:
    read = 'reader.integer("brightness", 50, (0, 100), "in percent")'
    install("lights", LIGHTS.replace("{read}", read), group=PLUGINS)
    section = "  lights:\n    brightness: 101\n    colour: red\n"
    path = edit("robot.yaml", "ros_parameters:\n", f"ros_parameters:\n{section}")
    edit("robot.yaml", "\nnodes:\n", "\nnodes:\n  - lights\n")
    line = path.read_text("utf-8").splitlines().index("    brightness: 101") + 1
    result = robotd("check", "--robot", str(path))
    assert result.exit_code == ExitCode.CONFIGURATION
    assert f"{path}:{line}: lights.brightness: 101 is outside 0 to 100" in result.stdout
    assert f"{path}:{line + 1}: lights.colour: the node has no such parameter" in result.stdout
    assert result.stdout.splitlines()[-1] == "2 problems"


def test_a_reader_of_parameters_that_fails_is_the_plugins_error(
    robotd: Robotd, edit: Edit, install: Install
) -> None:
    install("lights", LIGHTS.replace("{read}", "1 / 0"), group=PLUGINS)
    path = edit("robot.yaml", "\nnodes:\n", "\nnodes:\n  - lights\n")
    result = robotd("check", "--robot", str(path))
    assert result.exit_code == ExitCode.PLUGIN
    assert (
        "parameters of node 'lights' of plugin 'lights' (plugin_acme of acme 1.2)" in result.stdout
    )
    assert "ZeroDivisionError" in result.stdout


def test_missing_unknown_and_wrong_ros_parameters_are_reported_at_once(
    robotd: Robotd, edit: Edit
) -> None:
    """Each with file and line, without ROS."""
    edit("robot.yaml", "encoder_joint_topic: joint_states", "joint_feedback_rate: 100000")
    edit("robot.yaml", "wmx_gripper_topic:", "wmx_griper_topic:")
    path = edit("robot.yaml", "ros_parameters:\n", "ros_parameters:\n  wmx_io_node: {speed: 100}\n")
    first = path.read_text("utf-8").splitlines().index("ros_parameters:") + 1
    result = robotd("check", "--robot", str(path))
    assert result.exit_code == ExitCode.CONFIGURATION
    for text in (
        f":{first + 1}: wmx_io_node.speed: the node has no such parameter",
        f":{first + 3}: manipulator_state.joint_feedback_rate: 100000 is outside 1 to 500",
        "manipulator_state.encoder_joint_topic: missing",
        "follow_joint_trajectory_server.wmx_gripper_topic: missing",
        f":{first + 5}: follow_joint_trajectory_server.wmx_griper_topic: the node has no such",
        "did you mean 'wmx_gripper_topic'?",
    ):
        assert text in result.stdout
    assert result.stdout.splitlines()[-1] == "5 problems"


def test_a_node_for_which_the_robot_lacks_joints_is_reported(
    robotd: Robotd, tmp_path: Path
) -> None:
    path = tmp_path / "bare.yaml"
    path.write_text("schema: 1\nname: bare\naxes: 1\nnodes: [manipulator_state]\n", "utf-8")
    result = robotd("check", "--robot", str(path))
    assert "manipulator_state.joint_number: bare has no joints" in result.stdout


@pytest.mark.parametrize(
    ("parameter", "text"),
    [
        ("rate: 0", "rate: 0 is outside 1 to"),
        ("wheel_radius: -0.1", "wheel_radius: -0.1 is not above 0"),
        ("publish_tf: 1", "publish_tf: 1 is not true or false"),
        ("linear.x.max_jerk: -1.0", "linear.x.max_jerk: -1.0 is below 0"),
        ("pose_covariance_diagonal: [1.0]", "1 numbers instead of 6"),
        ("encoder_odometry_topic: 'odom enc'", "'odom enc' is not a ROS name"),
        ("odom_frame_id: 7", "odom_frame_id: 7 is not a text"),
        ("left_axis: 5", "left_axis: 5 contradicts drive.left_axis"),
        ("wmx_param_file_path: /nowhere.xml", "file '/nowhere.xml' does not exist"),
        ("acc_time: soon", "'soon' is not a number with a decimal point"),
    ],
)
def test_a_wrong_parameter_of_a_base_is_reported(
    robotd: Robotd, tmp_path: Path, parameter: str, text: str
) -> None:
    path = tmp_path / "robot.yaml"
    section = f"ros_parameters:\n  diff_drive_controller:\n    {parameter}\n"
    baymax = INSTALLED / "baymax" / "robot.yaml"
    path.write_text(f"extends: {baymax}\nname: base\n{section}", "utf-8")
    result = robotd("check", "--robot", str(path))
    assert text in result.stdout
    assert f"{path}:" in result.stdout
