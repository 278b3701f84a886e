"""Every name, type and QoS that clients of the reference rely on."""

from __future__ import annotations

from typing import Any

import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.action import get_action_names_and_types
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from tests.ros.robot_process import (
    ACTION,
    LATCHED,
    Client,
    RobotProcess,
    names_of,
    wait_until,
)

pytestmark = [pytest.mark.daily, pytest.mark.ros]

NODES = {
    "wmx_engine_node",
    "wmx_core_motion_node",
    "wmx_io_node",
    "wmx_ethercat_node",
    "manipulator_state",
    "follow_joint_trajectory_server",
    "joint_command_node",
    "gripper_controller",
}
SERVICES = {
    "/wmx/engine/set_device": "wmx_ros2_message/srv/SetEngine",
    "/wmx/engine/set_comm": "std_srvs/srv/SetBool",
    "/wmx/engine/get_status": "std_srvs/srv/Trigger",
    "/wmx/engine/get_fault": "std_srvs/srv/Trigger",
    "/wmx/engine/scan_network": "std_srvs/srv/Trigger",
    "/wmx/axis/set_on": "wmx_ros2_message/srv/SetAxis",
    "/wmx/axis/clear_alarm": "wmx_ros2_message/srv/SetAxis",
    "/wmx/axis/set_mode": "wmx_ros2_message/srv/SetAxis",
    "/wmx/axis/set_polarity": "wmx_ros2_message/srv/SetAxis",
    "/wmx/axis/stop": "wmx_ros2_message/srv/SetAxis",
    "/wmx/axis/homing": "wmx_ros2_message/srv/SetAxis",
    "/wmx/axis/set_gear_ratio": "wmx_ros2_message/srv/SetAxisGearRatio",
    "/wmx/params/load": "wmx_ros2_message/srv/LoadWmxParams",
    "/wmx/params/get": "wmx_ros2_message/srv/GetWmxParams",
    "/wmx/io/get_input_bit": "wmx_ros2_message/srv/GetIoBit",
    "/wmx/io/get_output_bit": "wmx_ros2_message/srv/GetIoBit",
    "/wmx/io/get_input_bytes": "wmx_ros2_message/srv/GetIoBytes",
    "/wmx/io/get_output_bytes": "wmx_ros2_message/srv/GetIoBytes",
    "/wmx/io/set_output_bit": "wmx_ros2_message/srv/SetIoBit",
    "/wmx/io/set_output_bytes": "wmx_ros2_message/srv/SetIoBytes",
    "/wmx/ecat/get_network_state": "wmx_ros2_message/srv/EcatGetNetworkState",
    "/wmx/ecat/register_read": "wmx_ros2_message/srv/EcatRegisterRead",
    "/wmx/ecat/reset_statistics": "wmx_ros2_message/srv/EcatResetStatistics",
    "/wmx/ecat/start_hotconnect": "wmx_ros2_message/srv/EcatStartHotconnect",
    "/wmx/set_gripper": "std_srvs/srv/SetBool",
}
PUBLISHED = {
    "/wmx/engine/ready": "std_msgs/msg/Bool",
    "/wmx/core_motion/ready": "std_msgs/msg/Bool",
    "/wmx/axis/state": "wmx_ros2_message/msg/AxisState",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/gazebo_position_controller/commands": "std_msgs/msg/Float64MultiArray",
}
SUBSCRIBED = {
    "/wmx/axis/velocity": "wmx_ros2_message/msg/AxisVelocity",
    "/wmx/axis/jog": "wmx_ros2_message/msg/AxisVelocity",
    "/wmx/axis/position": "wmx_ros2_message/msg/AxisPose",
    "/wmx/axis/position/relative": "wmx_ros2_message/msg/AxisPose",
    "/movensys_manipulator_arm_controller/joint_trajectory": "trajectory_msgs/msg/JointTrajectory",
    "/forward_position_controller/commands": "std_msgs/msg/Float64MultiArray",
    "/forward_velocity_controller/commands": "std_msgs/msg/Float64MultiArray",
    "/servo_node/delta_joint_cmds": "control_msgs/msg/JointJog",
}


def test_nodes(client: Client) -> None:
    wait_until(lambda: set(client.node.get_node_names()) >= NODES, "all nodes")


def test_services_have_the_names_and_types_of_the_reference(client: Client) -> None:
    wait_until(
        lambda: SERVICES.items() <= names_of(client.node.get_service_names_and_types()).items(),
        "all services",
    )


@pytest.mark.parametrize("topic", PUBLISHED)
def test_published_topics(client: Client, topic: str) -> None:
    wait_until(lambda: client.node.count_publishers(topic) == 1, topic)
    assert client.node.get_publishers_info_by_topic(topic)[0].topic_type == PUBLISHED[topic]


@pytest.mark.parametrize("topic", SUBSCRIBED)
def test_subscribed_topics(client: Client, topic: str) -> None:
    wait_until(lambda: client.node.count_subscribers(topic) == 1, topic)
    assert client.node.get_subscriptions_info_by_topic(topic)[0].topic_type == SUBSCRIBED[topic]


def test_action(client: Client) -> None:
    actions = wait_until(lambda: client.actions_of("follow_joint_trajectory_server"), "the action")
    assert actions == {ACTION: "control_msgs/action/FollowJointTrajectory"}


@pytest.mark.parametrize("topic", ["/wmx/engine/ready", "/wmx/core_motion/ready"])
def test_ready_is_latched_for_late_subscribers_and_repeated(client: Client, topic: str) -> None:
    messages = client.listen(Bool, topic, LATCHED)
    wait_until(lambda: len(messages) >= 2, "the latched message and a repetition", 5.0)
    assert all(message.data for message in messages)
    (info,) = client.node.get_publishers_info_by_topic(topic)
    assert info.qos_profile.reliability is ReliabilityPolicy.RELIABLE
    assert info.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL


@pytest.mark.parametrize("topic", ["/joint_states", "/wmx/axis/state"])
def test_state_topics_are_reliable_and_volatile(client: Client, topic: str) -> None:
    wait_until(lambda: client.node.count_publishers(topic), topic)
    (info,) = client.node.get_publishers_info_by_topic(topic)
    assert info.qos_profile.reliability is ReliabilityPolicy.RELIABLE
    assert info.qos_profile.durability is DurabilityPolicy.VOLATILE


@pytest.mark.parametrize(
    ("node", "name", "value"),
    [
        ("manipulator_state", "joint_feedback_rate", 100),
        ("manipulator_state", "encoder_joint_topic", "/elsewhere"),
        ("follow_joint_trajectory_server", "joint_trajectory_action", "/elsewhere"),
    ],
)
def test_parameters_refuse_to_be_set_at_run_time(
    client: Client, node: str, name: str, value: Any
) -> None:
    kind, field = (
        (ParameterType.PARAMETER_INTEGER, "integer_value")
        if isinstance(value, int)
        else (ParameterType.PARAMETER_STRING, "string_value")
    )
    parameter = Parameter(name=name, value=ParameterValue(type=kind, **{field: value}))
    response = client.call(SetParameters, f"/{node}/set_parameters", parameters=[parameter])
    (result,) = response.results
    assert not result.successful
    assert "read-only" in result.reason


def test_a_namespace_moves_all_but_what_a_parameter_says_absolutely() -> None:
    arguments = [
        "-r",
        "__ns:=/left",
        "-r",
        "joint_states:=joints",
        "-p",
        "wmx_gripper_topic:=/grip",
    ]
    with RobotProcess("--ros-args", *arguments) as process:
        process.wait_ready()
        client = Client(process.domain)
        try:
            client.wait_engine(topic="/left/wmx/engine/ready")
            response = client.call(Trigger, "/left/wmx/engine/get_status")
            assert (response.success, response.message) == (True, "Communicating")
            wait_until(lambda: client.node.count_publishers("/left/joints"), "remapped topic")

            def services() -> dict[str, str]:
                return names_of(client.node.get_service_names_and_types())

            wait_until(lambda: "/grip" in services(), "the renamed service")
            assert not [name for name in services() if name.startswith("/wmx")]
        finally:
            client.close()


def test_an_action_can_be_remapped() -> None:
    arguments = ("--nodes", "follow_joint_trajectory_server", "--ros-args", "-r")
    with RobotProcess(*arguments, f"{ACTION}:=/arm/follow") as process:
        process.wait_ready()
        client = Client(process.domain)
        wait_until(
            lambda: "/arm/follow" in names_of(get_action_names_and_types(client.node)),
            "the action under its new name",
        )
        names = names_of(get_action_names_and_types(client.node))
        client.close()
        assert ACTION not in names
