"""Exports agree with the descriptor; one that does not apply is rejected."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from robotd.cli.urdf_check import check_urdf
from robotd.clock import MonotonicClock
from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.errors import DescriptorError
from robotd.observation.tap import Tap
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_bases.diff_drive import DifferentialDrive
from robotd_export.export_command import export_function, export_targets
from robotd_export.export_input import ExportInput
from robotd_export.nav2 import twist_limits

ACTION = "movensys_manipulator_arm_controller/follow_joint_trajectory"

EXPORTS = {target: export_function(target) for target in export_targets()}


def changed(descriptor: RobotDescriptor, node: str, **parameters: Any) -> ExportInput:
    """The robot with other values of the parameters of one node."""
    values = descriptor.ros_parameters | {
        node: descriptor.ros_parameters.get(node, {}) | parameters
    }
    return ExportInput(descriptor.model_copy(update={"ros_parameters": values}))


@pytest.fixture(scope="module")
def cr3a() -> RobotDescriptor:
    return load_robot_descriptor("cr3a")


@pytest.fixture(scope="module")
def baymax() -> RobotDescriptor:
    return load_robot_descriptor("baymax")


def move_group(source: ExportInput) -> dict[str, Any]:
    """The parameters in the export for MoveIt."""
    content = yaml.safe_load(EXPORTS["moveit"](source))
    assert list(content) == ["/**"]
    parameters: dict[str, Any] = content["/**"]["ros__parameters"]
    return parameters


def action_of(parameters: dict[str, Any]) -> str:
    """The action's name as MoveIt puts it together."""
    manager = parameters["moveit_simple_controller_manager"]
    name = manager["controller_names"][0]
    action_ns = manager[name]["action_ns"]
    return f"/{name}/{action_ns}" if action_ns else f"/{name}"


def test_moveit_gets_the_joints_with_their_limits(cr3a: RobotDescriptor) -> None:
    parameters = move_group(ExportInput(cr3a))
    controller = parameters["moveit_simple_controller_manager"][ACTION.split("/", maxsplit=1)[0]]
    assert controller["type"] == "FollowJointTrajectory"
    assert controller["joints"] == list(cr3a.joint_names)
    limits = parameters["robot_description_planning"]["joint_limits"]
    assert set(limits) == set(cr3a.joint_names)
    for joint in cr3a.joints:
        assert limits[joint.name] == {
            "has_position_limits": True,
            "min_position": joint.lower_rad,
            "max_position": joint.upper_rad,
            "has_velocity_limits": True,
            "max_velocity": joint.velocity_rad_s,
            "has_acceleration_limits": True,
            "max_acceleration": joint.acceleration_rad_s2,
        }


@pytest.mark.parametrize(
    ("action", "namespace", "resolved"),
    [
        (ACTION, "/", f"/{ACTION}"),
        (f"/{ACTION}", "/left", f"/{ACTION}"),
        (ACTION, "/cell/left", f"/cell/left/{ACTION}"),
        ("follow", "/", "/follow"),
        ("~/follow", "/left", "/left/follow_joint_trajectory_server/follow"),
    ],
)
def test_moveit_reaches_the_action(
    cr3a: RobotDescriptor, action: str, namespace: str, resolved: str
) -> None:
    source = changed(cr3a, "follow_joint_trajectory_server", joint_trajectory_action=action)
    assert action_of(move_group(ExportInput(source.descriptor, namespace))) == resolved


def test_moveit_gets_a_controller_for_each_joint_group() -> None:
    source = ExportInput(load_robot_descriptor("dual_cr3a"), "/cell")
    manager = move_group(source)["moveit_simple_controller_manager"]
    assert manager["controller_names"] == ["cell/left_controller", "cell/right_controller"]
    for side in ("left", "right"):
        controller = manager[f"cell/{side}_controller"]
        assert controller["action_ns"] == "follow_joint_trajectory"
        assert controller["joints"] == [f"{side}_joint{number}" for number in range(1, 7)]


def test_moveit_waits_longer_than_the_robot_takes_for_a_result(cr3a: RobotDescriptor) -> None:
    assert move_group(ExportInput(cr3a))["trajectory_execution"] == {
        "execution_duration_monitoring": False,
        "allowed_start_tolerance": cr3a.trajectory.start_tolerance_rad,
        "allowed_goal_duration_margin": cr3a.trajectory.goal_time_s + 5.0,
    }


def test_moveit_servo_gets_the_topic_of_the_only_joint_group(cr3a: RobotDescriptor) -> None:
    servo = move_group(ExportInput(cr3a, "/left"))["moveit_servo"]
    assert servo["command_out_topic"] == (
        "/left/movensys_manipulator_arm_controller/joint_trajectory"
    )
    assert servo["command_out_type"] == "trajectory_msgs/JointTrajectory"
    assert servo["joint_topic"] == "/left/joint_states"
    other = changed(cr3a, "manipulator_state", encoder_joint_topic="~/states")
    assert move_group(other)["moveit_servo"]["joint_topic"] == "/manipulator_state/states"
    both = ExportInput(load_robot_descriptor("dual_cr3a"))
    assert "moveit_servo" not in move_group(both)
    topics = "/left_controller/joint_trajectory, /right_controller/joint_trajectory"
    assert f"command_out_topic: {topics}." in EXPORTS["moveit"](both)
    without = changed(cr3a, "joint_command_node", joint_trajectory_topic="")
    assert "moveit_servo" not in move_group(without)


def test_moveit_gets_the_gripper_s_action(cr3a: RobotDescriptor) -> None:
    manager = move_group(ExportInput(cr3a, "/left"))["moveit_simple_controller_manager"]
    name = manager["controller_names"][1]
    assert f"{name}/{manager[name]['action_ns']}" == "left/gripper_controller/gripper_cmd"
    assert manager[name]["type"] == "GripperCommand"
    assert manager[name]["joints"] == ["picker_1_joint", "picker_2_joint"]


def test_moveit_is_told_of_a_gripper_without_an_action_in_a_comment(cr3a: RobotDescriptor) -> None:
    source = changed(cr3a, "gripper_controller", gripper_action="")
    text = EXPORTS["moveit"](ExportInput(source.descriptor, "/left"))
    assert "/left/wmx/set_gripper (std_srvs/srv/SetBool)" in text
    assert "picker_1_joint, picker_2_joint" in text
    assert "(variant intel)" in text


def nodes_of_nav2(source: ExportInput) -> dict[str, dict[str, Any]]:
    content = yaml.safe_load(EXPORTS["nav2"](source))
    for name in ("local_costmap", "global_costmap"):
        content[name] = content[name][name]
    return {name: node["ros__parameters"] for name, node in content.items()}


def test_nav2_gets_topics_frames_and_limits(baymax: RobotDescriptor) -> None:
    source = changed(baymax, "diff_drive_controller", odom_frame_id="o", base_frame_id="b")
    nodes = nodes_of_nav2(source)
    for name in ("bt_navigator", "controller_server", "velocity_smoother"):
        assert nodes[name]["odom_topic"] == "/odom_enc"
    assert nodes["collision_monitor"]["cmd_vel_out_topic"] == "/cmd_vel"
    assert (nodes["local_costmap"]["global_frame"], nodes["behavior_server"]["local_frame"]) == (
        "o",
        "o",
    )
    assert {node["robot_base_frame"] for node in nodes.values() if "robot_base_frame" in node} == {
        "b"
    }
    drive = baymax.drive
    assert drive is not None
    assert nodes["velocity_smoother"]["max_velocity"] == [
        drive.velocity_m_s,
        0.0,
        drive.angular_velocity_rad_s,
    ]


def test_nav2_stays_within_the_gentler_of_ramp_and_limit(baymax: RobotDescriptor) -> None:
    source = changed(
        baymax,
        "diff_drive_controller",
        acc_time=4.0,
        dec_time=0.1,
        **{"linear.x.max_velocity": 0.8, "angular.z.max_acceleration": 0.25},
    )
    drive = baymax.drive
    assert drive is not None
    assert twist_limits(source) == {
        "max_velocity": [0.8, 0.0, drive.angular_velocity_rad_s],
        "min_velocity": [-0.8, 0.0, -drive.angular_velocity_rad_s],
        "max_accel": [0.2, 0.0, 0.25],
        "max_decel": [-drive.deceleration_m_s2, 0.0, -drive.angular_deceleration_rad_s2],
    }


@pytest.mark.parametrize("stamped", [False, True])
def test_nav2_sends_the_type_that_the_robot_takes(baymax: RobotDescriptor, stamped: bool) -> None:
    source = changed(baymax, "diff_drive_controller", use_stamped_vel=stamped)
    nodes = nodes_of_nav2(source)
    sending = {name for name, values in nodes.items() if "enable_stamped_cmd_vel" in values}
    assert {"controller_server", "behavior_server", "velocity_smoother"} < sending
    assert all(nodes[name]["enable_stamped_cmd_vel"] is stamped for name in sending)


def test_nav2_is_warned_of_a_missing_transform(baymax: RobotDescriptor) -> None:
    assert "publish_tf" in EXPORTS["nav2"](ExportInput(baymax))
    source = changed(baymax, "diff_drive_controller", publish_tf=True)
    assert "publish_tf" not in EXPORTS["nav2"](source)


def test_nav2_gets_a_mecanum_base(baymax: RobotDescriptor) -> None:
    mecanum = load_robot_descriptor("mecanum_base")
    source = changed(mecanum, "mecanum_drive_controller", **{"linear.y.max_velocity": 0.3})
    nodes = nodes_of_nav2(source)
    assert nodes["amcl"]["robot_model_type"] == "nav2_amcl::OmniMotionModel"
    assert nodes["controller_server"]["odom_topic"] == "/mecanum_drive_controller/odometry"
    command = nodes["collision_monitor"]["cmd_vel_out_topic"]
    assert command == "/mecanum_drive_controller/reference"
    assert nodes["velocity_smoother"]["enable_stamped_cmd_vel"] is True
    assert twist_limits(source) == {
        "max_velocity": [1.0, 0.3, 2.0],
        "min_velocity": [-1.0, -0.3, -2.0],
        "max_accel": [1.5, 1.0, 4.0],
        "max_decel": [-1.5, -1.0, -4.0],
    }
    assert "-r /mecanum_drive_controller/tf_odometry:=/tf" in EXPORTS["nav2"](source)
    plain = changed(mecanum, "mecanum_drive_controller", use_stamped_vel=False)
    command = nodes_of_nav2(plain)["collision_monitor"]["cmd_vel_out_topic"]
    assert command == "/mecanum_drive_controller/reference_unstamped"
    differential = nodes_of_nav2(ExportInput(baymax))["amcl"]["robot_model_type"]
    assert differential == "nav2_amcl::DifferentialMotionModel"


def test_isaac_gets_the_joints_of_the_arm() -> None:
    descriptor = load_robot_descriptor("cr3a", "orin")
    joints, clock = yaml.safe_load(EXPORTS["isaac"](ExportInput(descriptor)))["action_graph"]
    assert joints["topic"] == "/isaacsim/joint_command"
    assert joints["type"] == "sensor_msgs/msg/JointState"
    assert joints["joints"] == [*descriptor.joint_names, "picker_1_joint", "picker_2_joint"]
    assert clock["topic"] == "/clock"


def test_isaac_gets_the_wheels_of_a_base(baymax: RobotDescriptor) -> None:
    base, _ = yaml.safe_load(EXPORTS["isaac"](ExportInput(baymax, "/floor")))["action_graph"]
    assert base["topic"] == "/floor/cmd_vel_check"
    assert isinstance(baymax.drive, DifferentialDrive)
    assert base["wheel_radius_m"] == baymax.drive.wheel_radius_m
    assert base["wheel_distance_m"] == baymax.drive.wheel_separation_m


def test_isaac_is_told_of_a_calibration_of_the_real_wheels(baymax: RobotDescriptor) -> None:
    assert "calibrate" not in EXPORTS["isaac"](ExportInput(baymax))
    assert isinstance(baymax.drive, DifferentialDrive)
    drive = baymax.drive.model_copy(update={"wheel_separation_multiplier": 1.02})
    text = EXPORTS["isaac"](ExportInput(baymax.model_copy(update={"drive": drive})))
    assert "wheel_separation_multiplier 1.02, left_wheel_radius_multiplier 1," in text
    base, _ = yaml.safe_load(text)["action_graph"]
    assert base["wheel_distance_m"] == drive.wheel_separation_m


@pytest.mark.parametrize(
    ("codec", "declared"), [("iso-8859-1", "ISO-8859-1"), ("utf-16", "UTF-16")]
)
def test_export_page_and_recording_read_the_urdf_of_check(
    cr3a: RobotDescriptor, tmp_path: Path, codec: str, declared: str
) -> None:
    assert cr3a.urdf is not None
    text = cr3a.urdf.read_text(encoding="utf-8").replace("<robot", "<!-- é -->\n<robot", 1)
    path = tmp_path / "arm.urdf"
    path.write_bytes(text.replace('"UTF-8"', f'"{declared}"', 1).encode(codec))
    descriptor = cr3a.model_copy(update={"urdf": path})
    check_urdf(path, descriptor)
    assert ExportInput(descriptor).urdf() == text
    robot = Robot(descriptor, load_backend("sim"), MonotonicClock())
    assert Tap(robot, 1.0).urdf == text
    assert [tool.link for tool in robot.tools] == ["link6"]


def test_a_skid_steer_base_is_a_differential_one_for_others() -> None:
    robot = load_robot_descriptor("skid_steer_base")
    source = ExportInput(robot)
    parameters = yaml.safe_load(EXPORTS["nav2"](source))
    model = parameters["amcl"]["ros__parameters"]["robot_model_type"]
    assert model == "nav2_amcl::DifferentialMotionModel"
    graph = yaml.safe_load(EXPORTS["isaac"](source))["action_graph"]
    assert graph[0]["feeds"] == "Differential Controller"


def test_the_urdf_is_the_file(cr3a: RobotDescriptor) -> None:
    assert cr3a.urdf is not None
    assert EXPORTS["urdf"](ExportInput(cr3a)) == cr3a.urdf.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("target", "robot", "reason"),
    [
        ("nav2", "cr3a", "nav2: cr3a has no drive"),
        ("moveit", "baymax", "moveit: baymax has no joints"),
        ("isaac", "cr3a", "isaacsim_joint_topic is not given; try --variant orin"),
        ("isaac", "standalone", "publishes nothing for Isaac Sim"),
        ("urdf", "standalone", "standalone has no urdf"),
    ],
)
def test_what_does_not_apply_is_rejected(target: str, robot: str, reason: str) -> None:
    with pytest.raises(DescriptorError, match=reason):
        EXPORTS[target](ExportInput(load_robot_descriptor(robot)))


def test_an_arm_without_its_action_is_rejected(cr3a: RobotDescriptor) -> None:
    without = cr3a.model_copy(update={"nodes": ("wmx_io_node",)})
    with pytest.raises(DescriptorError, match="does not run the node follow"):
        EXPORTS["moveit"](ExportInput(without))
    unnamed = changed(cr3a, "follow_joint_trajectory_server", joint_trajectory_action="")
    with pytest.raises(DescriptorError, match=r"joint_trajectory_action is empty"):
        EXPORTS["moveit"](unnamed)
