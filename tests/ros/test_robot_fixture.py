"""The fixtures with whole robots, used as another project uses them."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from robotd.errors import DescriptorError, InvalidArgument
from robotd_testing.domain import own_domain
from robotd_testing.served_robot import RobotUnderTest

pytestmark = pytest.mark.ros
pytest_plugins = ["robotd_testing.robots"]

Start = Callable[..., RobotUnderTest]


def test_a_robot_moves_as_asked_over_ros(robotd_robot: Start) -> None:
    robot = robotd_robot("cr3a", time_scale=math.inf)
    reached, text = robot.move({"joint1": 0.3, "joint3": -0.2}, time_s=2.0)
    assert reached, text
    assert robot.joint_positions["joint1"] == pytest.approx(0.3, abs=1e-3)
    assert robot.joint_positions["joint3"] == pytest.approx(-0.2, abs=1e-3)
    robot.wait_standstill()


def test_services_and_topics_are_at_hand(robotd_robot: Start) -> None:
    robot = robotd_robot("cr3a")
    assert robot.call(Trigger, "wmx/engine/get_status").success
    assert not robot.gripper_closed
    robot.call(SetBool, "wmx/set_gripper", data=True)
    robot.wait_until(lambda: robot.gripper_closed, "gripper closes")
    with robot.client.listen(JointState, "joint_states") as states:
        stamp = states.wait().header.stamp
    assert stamp.sec + stamp.nanosec * 1e-9 == pytest.approx(robot.time_s, abs=1.0)


def test_a_failure_comes_at_its_time_and_ends_the_motion(
    robotd_robot: Start, robotd_log: Callable[[], str]
) -> None:
    robot = robotd_robot("cr3a", time_scale=math.inf)
    robot.fail(axis=2, at_s=0.5, code=77)
    reached, text = robot.move({"joint3": 0.5}, time_s=200.0)
    assert not reached
    assert "joint3" in text
    assert "amplifier alarm 77" in text
    robot.wait_standstill()
    assert robot.robot.image.amp_alarm[2]
    assert "fault=" in robotd_log()


def test_time_can_be_stepped(robotd_robot: Start) -> None:
    robot = robotd_robot("standalone")
    robot.step(1)
    before_s = robot.time_s
    robot.step(100)
    assert robot.time_s - before_s == pytest.approx(100 * robot.robot.control_loop.period_ns * 1e-9)
    robot.resume()
    robot.wait_until(lambda: robot.time_s > before_s + 1.0, "time passes")
    robot.pause()


def test_faults_that_do_not_exist_or_fit_are_rejected(robotd_robot: Start) -> None:
    robot = robotd_robot("standalone")
    with pytest.raises(DescriptorError, match="unknown key"):
        robot.inject("amp_alarmm", axis=1)
    with pytest.raises(InvalidArgument, match="outside"):
        robot.fail(axis=99)
    with pytest.raises(InvalidArgument, match="has no gripper"):
        _ = robot.gripper_closed


def test_a_wait_that_is_too_long_names_what_for(robotd_robot: Start) -> None:
    robot = robotd_robot("standalone")
    with pytest.raises(AssertionError, match=r"not within 0.05 s: pigs fly"):
        robot.wait_until(lambda: False, "pigs fly", timeout_s=0.05)


def test_a_scenario_goes_with_a_robot(robotd_robot: Start, tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("schema: 1\nfaults:\n  - {at_s: 0.1, engine_stopped: {}}\n", "utf-8")
    robot = robotd_robot("standalone", scenario=path)
    robot.wait_until(lambda: not robot.robot.connection.ready, "the engine stops")


def test_a_robot_starts_in_less_than_a_second_after_the_first(
    robotd_domain: int, robotd_log: Any
) -> None:
    from robotd_testing.served_robot import robot_under_test

    times_s = []
    for _ in range(4):
        begin_s = time.monotonic()
        with robot_under_test("cr3a", robotd_domain):
            times_s.append(time.monotonic() - begin_s)
    print("starts:", *(f"{time_s:.3f} s" for time_s in times_s))  # noqa: T201 - pytest -rP
    assert min(times_s[1:]) < 1.0, times_s


def test_each_test_has_a_domain_of_its_own(robotd_domain: int) -> None:
    assert os.environ["ROS_DOMAIN_ID"] == str(robotd_domain)
    with own_domain() as second, own_domain() as third:
        assert len({robotd_domain, second, third}) == 3
    with own_domain() as again:
        assert again == second


def test_the_log_is_shown_with_a_test_that_fails(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text('pytest_plugins = ["robotd_testing.robots"]\n', "utf-8")
    (tmp_path / "test_it.py").write_text(
        "def test_it(robotd_robot):\n    robotd_robot('standalone')\n    assert False\n", "utf-8"
    )
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path)]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=90)
    assert result.returncode == 1
    assert "robotd's log" in result.stdout
    assert "communication started" in result.stdout
