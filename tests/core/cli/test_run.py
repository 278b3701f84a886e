"""``robotd run`` up to the point where ROS takes over, and the page it prints."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import Result

from robotd.cli.exit_codes import ExitCode, exit_code
from robotd.cli.preflight import process_age_s, realtime_permitted
from robotd.clock.simulated import PacedClock
from robotd.errors import ConnectError, OperationError
from robotd.plugin.manager import PLUGINS
from robotd.robot import Robot

Robotd = Callable[..., Result]

REPORT = SimpleNamespace(
    nodes=("/manipulator_state",),
    topics=(
        SimpleNamespace(name="/joint_states", type="sensor_msgs/msg/JointState", rate_hz=500.0),
        SimpleNamespace(name="/wmx/axis/velocity", type="x/msg/AxisVelocity", rate_hz=None),
    ),
    services=("/one", "/two"),
    actions=("/arm/follow_joint_trajectory",),
)


class Server:
    """Stands for ``robotd_ros.serve``: remembers the call, then does what the test wants."""

    def __init__(self) -> None:
        self.robot: Robot | None = None
        self.nodes: tuple[str, ...] = ()
        self.ros_args: list[str] = []
        self.faults: Any = None
        self.before: Exception | None = None
        self.after: Exception | None = None

    def serve(
        self,
        robot: Robot,
        nodes: Any,
        ros_args: Any,
        *,
        registry: Any,
        served: Any,
        ready: Any,
        ended: Any,
        parts: Any,
    ) -> int:
        self.robot, self.nodes, self.ros_args = robot, tuple(nodes), list(ros_args)
        self.registry, self.faults = registry, parts.get("scenario")
        if self.before:
            raise self.before
        served(REPORT)
        if self.after:
            assert ended(self.after) == exit_code(self.after)
            raise self.after
        ready()
        self.run()
        return int(ended(None))

    def run(self) -> None:
        """Run between ready and the stop."""


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Server:
    stand_in = Server()
    monkeypatch.setattr("robotd.cli.run_command.import_ros", lambda name: stand_in)
    return stand_in


def test_the_robots_nodes_are_served(robotd: Robotd, server: Server) -> None:
    result = robotd("--robot", "cr3a", "--ros-args", "-r", "a:=b")
    assert result.exit_code == 0, result.output
    assert server.robot is not None
    assert server.nodes == server.robot.descriptor.nodes
    assert server.ros_args == ["--ros-args", "-r", "a:=b"]
    assert server.robot.backend.name == "sim"


def test_variant_rate_and_nodes_are_those_asked_for(robotd: Robotd, server: Server) -> None:
    options = ["--variant", "orin", "--rate", "250", "--nodes", "wmx_io_node,wmx_engine_node"]
    assert robotd("--robot", "cr3a", *options).exit_code == 0
    assert server.robot is not None
    assert server.robot.descriptor.variant == "orin"
    assert server.robot.descriptor.cycle.rate_hz == 250.0
    assert server.robot.control_loop.period_ns == 4_000_000
    assert server.nodes == ("wmx_io_node", "wmx_engine_node")


def test_the_rate_leaves_the_rest_of_the_cycle_alone(robotd: Robotd, server: Server) -> None:
    robotd("--robot", "cr3a")
    assert server.robot is not None
    own = server.robot.descriptor.cycle
    robotd("--robot", "cr3a", "--rate", "250")
    assert server.robot.descriptor.cycle == own.model_copy(update={"rate_hz": 250.0})


def test_a_node_that_the_robot_does_not_have_is_a_usage_error(
    robotd: Robotd, server: Server
) -> None:
    result = robotd("--robot", "standalone", "--nodes", "wmx_io_nod")
    assert result.exit_code == ExitCode.USAGE
    assert "unknown node of standalone 'wmx_io_nod'; did you mean 'wmx_io_node'?" in result.stderr
    assert server.robot is None


@pytest.mark.parametrize(
    ("options", "code", "text"),
    [
        (["--robot", "cr33a"], ExitCode.CONFIGURATION, "did you mean 'cr3a'?"),
        (["--robot", "./no/robot.yaml"], ExitCode.CONFIGURATION, "no/robot.yaml"),
        (["--robot", "cr3a", "--variant", "x"], ExitCode.CONFIGURATION, "intel, orin"),
        (["--robot", "cr3a", "--backend", "x"], ExitCode.PLUGIN, "unknown backend 'x'"),
    ],
)
def test_what_is_wrong_is_told_before_ros_is_touched(
    robotd: Robotd, server: Server, options: list[str], code: int, text: str
) -> None:
    result = robotd(*options)
    assert result.exit_code == code
    assert result.stderr.startswith("robotd: error: ")
    assert text in result.stderr
    assert server.robot is None


def test_a_broken_plugin_is_a_warning_and_the_robot_runs(
    robotd: Robotd, server: Server, install: Callable[..., Any]
) -> None:
    install("bad", "1 / 0", distribution="bad", group=PLUGINS)
    result = robotd("--robot", "cr3a")
    assert result.exit_code == 0
    assert "robotd: warning: plugin 'bad'" in result.stderr


def test_time_and_faults_are_those_asked_for(
    robotd: Robotd, server: Server, tmp_path: Path
) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("schema: 1\nfaults:\n  - amp_alarm: {axis: 1}\n", "utf-8")
    result = robotd("--robot", "cr3a", "--time-scale", "10", "--scenario", str(path))
    assert result.exit_code == 0, result.output
    assert server.robot is not None
    assert isinstance(server.robot.clock, PacedClock)
    assert server.robot.clock.scale == 10.0
    assert [fault.name for fault in server.faults.waiting] == ["amp_alarm"]
    assert "simulated, 10 times real time; on /clock" in result.stdout
    assert robotd("--robot", "cr3a", "--time-scale", "max").exit_code == 0
    assert server.robot.clock.scale == math.inf
    assert robotd("--robot", "cr3a").exit_code == 0
    assert not server.faults.waiting


@pytest.mark.parametrize("option", [("--time-scale", "2"), ("--scenario", "x.yaml")])
def test_a_real_robot_has_no_simulated_time(
    robotd: Robotd, server: Server, install: Callable[..., Any], option: tuple[str, str]
) -> None:
    install("acme")
    result = robotd("--robot", "cr3a", "--backend", "acme", *option)
    assert result.exit_code == ExitCode.USAGE
    assert "the backend acme is not simulated" in result.stderr
    assert server.robot is None


def test_ros_that_does_not_start_is_told_from_a_device_that_does_not(
    robotd: Robotd, server: Server
) -> None:
    server.before = OperationError("ROS does not start: bad remap")
    result = robotd("--robot", "cr3a")
    assert result.exit_code == ExitCode.ROS
    assert result.stderr == "robotd: error: ROS does not start: bad remap\n"
    server.before, server.after = None, ConnectError("no device")
    assert robotd("--robot", "cr3a").exit_code == ExitCode.DEVICE


def test_the_report_tells_every_period(
    robotd: Robotd, server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run_two_periods() -> None:
        assert server.robot is not None
        server.robot.control_loop.stats.record(1_000, 10_000, 15_000)
        server.robot.control_loop.stats.record(3_000, 20_000, 27_000)

    monkeypatch.setattr(server, "run", run_two_periods)
    path = tmp_path / "report.json"
    assert robotd("--robot", "cr3a", "--report", str(path)).exit_code == 0
    report = json.loads(path.read_text())
    assert report["period_ns"] == 2_000_000
    assert report["report"]["cycles"] == 2
    assert report["report"]["lateness_max_us"] == 3.0
    assert report["samples"] == {
        "start_ns": [10_000, 20_000],
        "lateness_ns": [1_000, 3_000],
        "execution_ns": [5_000, 7_000],
    }


def test_a_report_that_cannot_be_written_is_told_before_ros_is_touched(
    robotd: Robotd, server: Server
) -> None:
    result = robotd("--robot", "cr3a", "--report", "/nowhere/report.json")
    assert result.exit_code == ExitCode.USAGE
    assert "/nowhere/report.json: No such file or directory" in result.stderr
    assert server.robot is None


def test_the_page_tells_everything(robotd: Robotd, server: Server) -> None:
    page = robotd("--robot", "cr3a", "--verbose").stdout
    assert "\x1b" not in page
    for text in (
        "cr3a on sim",
        "Dobot CR3A",
        "intel (available: orin, canopen_simulated, canopen_multicast, ethercat_simulated)",
        "sim: simulated",
        "500 Hz",
        "joint3  axis 2  -2.86 to +2.86 rad  3.14 rad/s  12.57 rad/s²",
        "output bit 0.0 moves picker_1_joint, picker_2_joint",
        "/manipulator_state",
        "/joint_states       500 Hz  sensor_msgs/msg/JointState",
        "/wmx/axis/velocity          x/msg/AxisVelocity",
        "services  2",
        "/arm/follow_joint_trajectory",
    ):
        assert text in page
    assert max(map(len, page.splitlines())) <= 120
    assert re.search(r"^ready after \d+\.\d s, stop with Ctrl-C$", page, re.MULTILINE)


def test_the_first_output_is_short_and_says_what_to_type(
    robotd: Robotd, server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robotd.cli.start_summary.realtime_permitted", lambda priority: True)
    lines = robotd("--robot", "cr3a").stdout.splitlines()
    assert len(lines) <= 12
    for text in (
        "cr3a on sim",
        "Dobot CR3A",
        "SIMULATED",
        "--verbose lists them",
        "robotd status",
        "robotd jog joint1 0.1",
        "robotd stop",
    ):
        assert any(text in line for line in lines), text
    assert not any("jog" in line for line in robotd("--robot", "baymax").stdout.splitlines())


def test_a_robot_without_joints_is_told_so(robotd: Robotd, server: Server) -> None:
    page = robotd("--robot", "standalone", "--verbose").stdout
    assert "no servo is switched on at start" in page
    assert re.search(r"axes +2, 0 to 1$", page, re.MULTILINE)


@pytest.mark.parametrize(
    ("robot", "wheels"),
    [
        ("baymax", "differential, radius 0.09 m, 0.55 m apart"),
        ("mecanum_base", "mecanum, radius"),
        ("skid_steer_base", "skid_steer, radius 0.165 m, 0.57 m apart"),
        ("tricycle_base", "tricycle, radius 0.1 m, wheelbase 0.8 m, steers 1.2 rad"),
    ],
)
def test_the_wheels_of_a_base_are_told(
    robotd: Robotd, server: Server, robot: str, wheels: str
) -> None:
    page = robotd("--robot", robot, "--verbose").stdout
    assert wheels in page
    assert re.search(r"at most [\d.]+ m/s and [\d.]+ rad/s", page)


@pytest.mark.parametrize("permitted", [True, False])
def test_missing_real_time_priority_is_told_with_its_remedy(
    robotd: Robotd, server: Server, monkeypatch: pytest.MonkeyPatch, permitted: bool
) -> None:
    monkeypatch.setattr("robotd.cli.start_summary.realtime_permitted", lambda priority: permitted)
    page = robotd("--robot", "cr3a").stdout
    assert ("real-time priority" in page) is not permitted
    assert ("limits.conf" in page) is not permitted


def test_an_impossible_priority_is_not_permitted() -> None:
    assert not realtime_permitted(1000)


def test_a_process_gets_older() -> None:
    first = process_age_s()
    assert 0.0 < first <= process_age_s()


def run_without_ros(**environment: str) -> subprocess.CompletedProcess[str]:
    program = (
        "import sys\n"
        "sys.modules['rclpy'] = None\n"
        "from robotd.cli import main, preflight\n"
        "preflight.HAS_ROS_WHEELS = False\n"
        "main(['--robot', 'cr3a'])"
    )
    return subprocess.run(
        [sys.executable, "-c", program],
        check=False,
        capture_output=True,
        text=True,
        timeout=50,
        env={"PATH": "/usr/bin:/bin", **environment},
    )


def test_missing_ros_is_one_sentence_with_the_remedy() -> None:
    result = run_without_ros()
    assert result.returncode == ExitCode.ROS
    assert "pip install 'robotd[ros]'" in result.stderr
    assert "/opt/ros/jazzy/setup.bash" in result.stderr
    assert result.stderr.startswith("robotd: error: ROS 2 cannot be imported")
    assert "Traceback" not in result.stderr


def test_another_ros_is_warned_of() -> None:
    result = run_without_ros(ROS_DISTRO="humble")
    assert result.stderr.startswith("robotd: warning: ROS_DISTRO is 'humble'")
