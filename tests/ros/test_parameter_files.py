"""Parameter files of the reference, unchanged but for the path of the XML file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import GetParameters
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from tests.ros.robot_process import ACTION, Client, RobotProcess, names_of, wait_until
from wmx_ros2_message.srv import GetWmxParams

pytestmark = [pytest.mark.daily, pytest.mark.ros, pytest.mark.second_backend]

NAMES = [f"joint{number}" for number in range(1, 7)] + ["picker_1_joint", "picker_2_joint"]
ROBOTS = Path(__file__).parents[2] / "robots"
GAZEBO, ISAAC_SIM = "/gazebo_position_controller/commands", "/isaacsim/joint_command"

ARM = """\
manipulator_state:
  ros__parameters:
    joint_number: 6
    joint_feedback_rate: 500
    gripper_open_value: 0.00
    gripper_close_value: 0.045
    joint_name: ["joint1", "joint2", "joint3", "joint4", "joint5", "joint6",
                  "picker_1_joint", "picker_2_joint"]
    encoder_joint_topic: /joint_states
    {mirror}
    wmx_param_file_path: {path}

follow_joint_trajectory_server:
  ros__parameters:
    joint_number: 6
    wmx_gripper_topic: /wmx/set_gripper
    joint_trajectory_action: /movensys_manipulator_arm_controller/follow_joint_trajectory
"""
INTEL = ARM.replace("{mirror}", f"gazebo_joint_topic: {GAZEBO}")
ORIN = ARM.replace("{mirror}", f"isaacsim_joint_topic: {ISAAC_SIM}")
BASE = """\
diff_drive_controller:
  ros__parameters:
    left_axis: 0
    right_axis: 1
    rate: 100
    acc_time: 1.0
    dec_time: 1.0
    wheel_radius: 0.09
    wheel_to_wheel: 0.55
    cmd_vel_topic: /cmd_vel
    encoder_vel_topic: /cmd_vel_check
    encoder_omega_topic: /velocity_controller/commands
    encoder_odometry_topic: /odom_enc
    wmx_param_file_path: {path}
"""
# The same arm and base with other defaults, so that what is seen comes from the files above.
OTHER_ARM = """\
schema: 1
name: other
extends: {robots}/cr3a/robot.yaml
default_variant: null
variants: null
ros_parameters:
  manipulator_state:
    joint_feedback_rate: 20
    gripper_close_value: 0.001
    joint_name: [a1, a2, a3, a4, a5, a6, f1, f2]
    encoder_joint_topic: /other/joints
  follow_joint_trajectory_server:
    wmx_gripper_topic: /other/gripper
    joint_trajectory_action: /other/action
"""
OTHER_BASE = """\
schema: 1
name: other
extends: {robots}/baymax/robot.yaml
ros_parameters:
  diff_drive_controller:
    rate: 20
    acc_time: 2.0
    cmd_vel_topic: /other/cmd
    encoder_vel_topic: /other/echo
    encoder_omega_topic: /other/omega
    encoder_odometry_topic: /other/odom
"""


class Deployment:
    """A robot, a parameter file and the vendor's XML that it points to."""

    def __init__(self, folder: Path, robot: str, kind: str, text: str) -> None:
        self.robot = folder / "robot.yaml"
        self.robot.write_text(robot.format(robots=ROBOTS))
        self.xml = folder / "wmx_parameters.xml"
        original = (ROBOTS / kind / "wmx_parameters.xml").read_text()
        self.xml.write_text(original.replace("0.001000</InPosWidth>", "0.004000</InPosWidth>"))
        self.parameters = folder / "parameters.yaml"
        self.parameters.write_text(text.format(path=self.xml))

    def start(self) -> RobotProcess:
        arguments = ("--ros-args", "--params-file", str(self.parameters))
        return RobotProcess(*arguments, robot=str(self.robot))


@contextmanager
def serving(folder: Path, robot: str, kind: str, text: str) -> Iterator[Client]:
    """A client of the deployment, once its robot has read the deployment's XML."""
    with Deployment(folder, robot, kind, text).start() as process:
        process.wait_ready()
        client = Client(process.domain)
        try:
            client.wait_engine()
            response = client.call(GetWmxParams, "/wmx/params/get", index=[0])
            assert any("0.004" in line for line in response.params_dump)
            yield client
        finally:
            client.close()


def rate_hz(client: Client, messages: list[Any], count: int) -> float:
    """By the stamps of ``count`` messages; a busy computer may lose some between others."""
    client.next(messages)
    start = len(messages)
    wait_until(lambda: len(messages) > start + count, f"{count} messages")
    stamps = [message.header.stamp for message in messages[start : start + count]]
    seconds = np.diff([stamp.sec + stamp.nanosec * 1e-9 for stamp in stamps])
    return float(1.0 / np.percentile(seconds, 20))


@pytest.mark.parametrize(
    ("text", "published", "silent"),
    [
        pytest.param(INTEL, GAZEBO, ISAAC_SIM, marks=pytest.mark.long),
        (ORIN, ISAAC_SIM, GAZEBO),
    ],
    ids=["intel", "orin"],
)
def test_the_two_files_of_the_arm(tmp_path: Path, text: str, published: str, silent: str) -> None:
    with serving(tmp_path, OTHER_ARM, "cr3a", text) as client:
        joints = client.listen(JointState, "/joint_states")
        assert rate_hz(client, joints, 200) == pytest.approx(500, rel=0.2)
        assert list(joints[-1].name) == NAMES
        assert client.call(SetBool, "/wmx/set_gripper", data=True).success
        client.next(joints, lambda message: list(message.position[6:]) == [0.045, 0.045])
        wait_until(lambda: client.node.count_publishers(published), published)
        topics = names_of(client.node.get_topic_names_and_types())
        goals = f"{ACTION}/_action/send_goal"
        wait_until(lambda: client.node.count_services(goals), goals)
        services = names_of(client.node.get_service_names_and_types())
        assert silent not in topics
        assert not [name for name in (*topics, *services) if name.startswith("/other")]


def test_the_file_of_the_base(tmp_path: Path) -> None:
    with serving(tmp_path, OTHER_BASE, "baymax", BASE) as client:
        odometry = client.listen(Odometry, "/odom_enc")
        assert rate_hz(client, odometry, 50) == pytest.approx(100, rel=0.2)
        wait_until(lambda: client.node.count_subscribers("/cmd_vel"), "the commands")
        for topic in ("/cmd_vel_check", "/velocity_controller/commands"):
            wait_until(lambda name=topic: client.node.count_publishers(name), topic)
        topics = names_of(client.node.get_topic_names_and_types())
        assert not [name for name in topics if name.startswith("/other")]
        names = ["acc_time", "wheel_radius"]
        response = client.call(GetParameters, "/diff_drive_controller/get_parameters", names=names)
        assert [value.double_value for value in response.values] == [1.0, 0.09]


@pytest.mark.parametrize(
    ("robot", "kind", "text", "node"),
    [
        (OTHER_ARM, "cr3a", INTEL, "manipulator_state"),
        pytest.param(OTHER_BASE, "baymax", BASE, "diff_drive_controller", marks=pytest.mark.long),
    ],
    ids=["arm", "base"],
)
def test_a_missing_xml_is_said_before_anything_opens(
    tmp_path: Path, robot: str, kind: str, text: str, node: str
) -> None:
    deployment = Deployment(tmp_path, robot, kind, text)
    deployment.xml.unlink()
    with deployment.start() as process:
        assert process.exit_status() == 3
        key = f"{node}.wmx_param_file_path"
        assert f"robotd: error: {key}: file '{deployment.xml}' does not exist" in process.output
        assert "device open" not in process.output
