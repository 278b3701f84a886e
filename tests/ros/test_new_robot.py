"""Robots made by ``robotd new-robot``, served by a process and moved over DDS."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
from control_msgs.action import FollowJointTrajectory
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from tests.ros.robot_process import Client, RobotProcess, command_until
from trajectory_msgs.msg import JointTrajectoryPoint

pytestmark = pytest.mark.ros

URDFS = Path(__file__).parents[1] / "urdf"
PAGE = (Path(__file__).parents[2] / "docs/tutorial/own-robot.md").read_text(encoding="utf-8")
PRESS = PAGE.partition("```xml\n")[2].partition("```")[0]


def robotd(domain: int, *arguments: str, folder: Path | None = None) -> str:
    """Output of a command that succeeds, run in ``folder``."""
    environment = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    done = subprocess.run(
        [sys.executable, "-m", "robotd", *arguments],
        capture_output=True, text=True, timeout=90, check=False,
        env=os.environ | environment, cwd=folder,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="class")
def press(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RobotProcess]:
    """The robot of the tutorial, made and run by its commands."""
    folder = tmp_path_factory.mktemp("press")
    (folder / "press.urdf").write_text(PRESS, encoding="utf-8")
    robotd(0, "new-robot", "press", "--urdf", "press.urdf", folder=folder)
    with RobotProcess("--verbose", robot=str(folder / "press" / "robot.yaml")) as process:
        process.wait_ready()
        yield process


@contextmanager
def new_robot(name: str, folder: Path) -> Iterator[Client]:
    """Client of a new robot in a process of its own."""
    robotd(0, "new-robot", name, "--urdf", str(URDFS / f"{name}.urdf"), folder=folder)
    with RobotProcess(robot=str(folder / name / "robot.yaml")) as process:
        process.wait_ready()
        with closing(Client(process.domain)) as client:
            yield client


def goal(positions: dict[str, float], time_s: int) -> Any:
    message = FollowJointTrajectory.Goal()
    message.trajectory.joint_names = list(positions)
    point = JointTrajectoryPoint(positions=list(positions.values()))
    point.time_from_start.sec = time_s
    message.trajectory.points = [point]
    return message


class TestTutorial:
    def test_its_commands_do_what_it_says(self, press: RobotProcess) -> None:
        output = robotd(press.domain, "move", "turntable=45", "slide=0.2", "--deg")
        assert output.startswith("goal reached after 2.000 s; ")
        with closing(Client(press.domain)) as client:
            state = client.next(client.listen(JointState, "joint_states"))
        assert list(state.name) == ["turntable", "slide"]
        assert list(state.position) == pytest.approx([0.7854, 0.2], abs=2e-3)
        for line in ("turntable  axis 0  -1.57 to +1.57 rad  2.00 rad/s  8.00 rad/s²",
                     "slide      axis 1  +0.00 to +0.25 m    0.50 m/s    2.00 m/s²"):  # fmt: skip
            assert line in PAGE
            assert line in press.output

    def test_a_stroke_beyond_the_end_is_rejected_in_m(self, press: RobotProcess) -> None:
        action = "/press_arm_controller/follow_joint_trajectory"
        with closing(Client(press.domain)) as client:
            _, result = client.send_goal(goal({"slide": 0.3}, 2), action=action).result()
        assert result.error_string == "slide at 2.000 s: position 0.3 m exceeds 0.25 m"
        assert f"robotd: error: {result.error_string}" in PAGE

    def test_a_jog_of_a_prismatic_joint_is_in_m(self, press: RobotProcess) -> None:
        ends = []
        for options in ((), ("--deg",)):  # degrees are for joints that turn
            output = robotd(press.domain, "jog", "slide", "+0.01", *options)
            match = re.match(r"slide: (\+0\.\d+) m; goal reached", output)
            assert match, output
            ends.append(float(match[1]))
        assert ends[1] - ends[0] == pytest.approx(0.01, abs=2e-4)

    def test_its_status_has_names_and_units(self, press: RobotProcess) -> None:
        first, second = json.loads(robotd(press.domain, "status", "--json"))["axes"]
        assert (first["name"], first["unit"]) == ("turntable", "rad")
        assert (second["name"], second["unit"]) == ("slide", "m")
        lines = robotd(press.domain, "status").splitlines()
        (slide,) = (line for line in lines if " slide " in line)
        assert " m/s " in slide
        assert "rad" not in slide

    def test_a_robot_is_made_from_the_description_of_a_running_one(
        self, press: RobotProcess, tmp_path: Path
    ) -> None:
        output = robotd(press.domain, "new-robot", "copy", folder=tmp_path)
        assert "all checks passed" in output
        assert (tmp_path / "copy" / "copy.urdf").read_text(encoding="utf-8") == PRESS


def test_a_mobile_manipulator_moves_arm_and_base_at_once(tmp_path: Path) -> None:
    action = "/mobile_manipulator_arm_controller/follow_joint_trajectory"
    targets = {"arm_joint1": 0.8, "arm_joint6": -1.0}
    twist = Twist()
    twist.linear.x = 0.2
    with new_robot("mobile_manipulator", tmp_path) as client:
        motion = client.send_goal(goal(targets, 3), action=action)
        odometry = client.listen(Odometry, "odom")
        commands = client.publisher(Twist, "cmd_vel")

        def has_driven() -> bool:
            return bool(odometry) and odometry[-1].pose.pose.position.x > 0.05

        condition = "the base has driven 50 mm while the arm moves"
        command_until(lambda: commands.publish(twist), has_driven, condition)
        assert odometry[-1].child_frame_id == "base_footprint"
        _, result = motion.result()
        assert result.error_string.startswith("goal reached")


@pytest.mark.daily
def test_fingers_move_by_their_multipliers(tmp_path: Path) -> None:
    with new_robot("six_axis", tmp_path) as client:
        states = client.listen(JointState, "joint_states")
        assert client.call(SetBool, "wmx/set_gripper", data=True).success
        closed = client.next(states, lambda state: state.position[6] > 0.799)
        assert list(closed.position[6:]) == pytest.approx([0.8, -0.8])
