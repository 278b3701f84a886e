"""Every name of the vendor's package is on the migration page and is served, as the page says.

The names, types and defaults below are those of wmx_ros2_package, in the current layout of
wmx_ros2_message.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from tests.contract.surfaces import made_nodes

from robotd.robot import build_robot
from robotd_ros.nodes.node_parameters import Parameters
from robotd_ros.run_nodes import report_of

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "migrate.md").read_text(encoding="utf-8")
VERDICTS = {"same", "better", "changed"}
ROBOTS = (("cr3a", "intel"), ("cr3a", "orin"), ("baymax", None))
MESSAGES = "wmx_ros2_message"
REQUIRED = ""  # a name that has to be given

NODES = {
    "wmx_engine_node",
    "wmx_core_motion_node",
    "wmx_io_node",
    "wmx_ethercat_node",
    "manipulator_state",
    "follow_joint_trajectory_server",
    "diff_drive_controller",
}
LAUNCH_FILES = {
    "wmx_ros2_multi_node.launch.py",
    "wmx_ros2_intel_manipulator_cr3a.launch.py",
    "wmx_ros2_orin_manipulator_cr3a.launch.py",
    "wmx_ros2_diff_drive_controller.launch.py",
    "wmx_ros2_general_package.launch.py",
    "wmx_ros2_general_nodes.launch.py",
    "wmx_ros2_cr3a_manipulator.launch.py",
}
FILES = {
    "intel_manipulator_config_cr3a.yaml": "ros/ament/config/intel_manipulator_config_cr3a.yaml",
    "orin_manipulator_config_cr3a.yaml": "ros/ament/config/orin_manipulator_config_cr3a.yaml",
    "diff_drive_controller_config.yaml": "ros/ament/config/diff_drive_controller_config.yaml",
    "cr3a_manipulator_config.yaml": "ros/ament/config/cr3a_manipulator_config.yaml",
    "cr3a_wmx_parameters.xml": "robots/cr3a/wmx_parameters.xml",
    "baymax_wmx_parameters.xml": "robots/baymax/wmx_parameters.xml",
}
SERVICES = {
    "/wmx/engine/set_device": f"{MESSAGES}/srv/SetEngine",
    "/wmx/engine/set_comm": "std_srvs/srv/SetBool",
    "/wmx/engine/get_status": "std_srvs/srv/Trigger",
    "/wmx/engine/scan_network": "std_srvs/srv/Trigger",
    "/wmx/axis/set_on": f"{MESSAGES}/srv/SetAxis",
    "/wmx/axis/clear_alarm": f"{MESSAGES}/srv/SetAxis",
    "/wmx/axis/set_mode": f"{MESSAGES}/srv/SetAxis",
    "/wmx/axis/set_polarity": f"{MESSAGES}/srv/SetAxis",
    "/wmx/axis/homing": f"{MESSAGES}/srv/SetAxis",
    "/wmx/axis/set_gear_ratio": f"{MESSAGES}/srv/SetAxisGearRatio",
    "/wmx/params/load": f"{MESSAGES}/srv/LoadWmxParams",
    "/wmx/params/get": f"{MESSAGES}/srv/GetWmxParams",
    "/wmx/io/get_input_bit": f"{MESSAGES}/srv/GetIoBit",
    "/wmx/io/get_output_bit": f"{MESSAGES}/srv/GetIoBit",
    "/wmx/io/get_input_bytes": f"{MESSAGES}/srv/GetIoBytes",
    "/wmx/io/get_output_bytes": f"{MESSAGES}/srv/GetIoBytes",
    "/wmx/io/set_output_bit": f"{MESSAGES}/srv/SetIoBit",
    "/wmx/io/set_output_bytes": f"{MESSAGES}/srv/SetIoBytes",
    "/wmx/ecat/get_network_state": f"{MESSAGES}/srv/EcatGetNetworkState",
    "/wmx/ecat/register_read": f"{MESSAGES}/srv/EcatRegisterRead",
    "/wmx/ecat/reset_statistics": f"{MESSAGES}/srv/EcatResetStatistics",
    "/wmx/ecat/start_hotconnect": f"{MESSAGES}/srv/EcatStartHotconnect",
    "/wmx/set_gripper": "std_srvs/srv/SetBool",
}
JOINT_STATE, TWIST = "sensor_msgs/msg/JointState", "geometry_msgs/msg/Twist"
ARRAY = "std_msgs/msg/Float64MultiArray"
TOPICS = {  # as on the page: by name, or by the parameter that names it
    "/wmx/engine/ready": ("/wmx/engine/ready", "std_msgs/msg/Bool"),
    "/wmx/core_motion/ready": ("/wmx/core_motion/ready", "std_msgs/msg/Bool"),
    "/wmx/axis/state": ("/wmx/axis/state", f"{MESSAGES}/msg/AxisState"),
    "/wmx/axis/velocity": ("/wmx/axis/velocity", f"{MESSAGES}/msg/AxisVelocity"),
    "/wmx/axis/position": ("/wmx/axis/position", f"{MESSAGES}/msg/AxisPose"),
    "/wmx/axis/position/relative": ("/wmx/axis/position/relative", f"{MESSAGES}/msg/AxisPose"),
    "encoder_joint_topic": ("/joint_states", JOINT_STATE),
    "isaacsim_joint_topic": ("/isaacsim/joint_command", JOINT_STATE),
    "gazebo_joint_topic": ("/gazebo_position_controller/commands", ARRAY),
    "cmd_vel_topic": ("/cmd_vel", TWIST),
    "encoder_vel_topic": ("/cmd_vel_check", TWIST),
    "encoder_omega_topic": ("/velocity_controller/commands", ARRAY),
    "encoder_odometry_topic": ("/odom_enc", "nav_msgs/msg/Odometry"),
}
ACTION = "/movensys_manipulator_arm_controller/follow_joint_trajectory"
PARAMETERS: dict[str, dict[str, Any]] = {
    "manipulator_state": {
        "joint_number": 0,
        "joint_feedback_rate": 0,
        "gripper_open_value": 0.0,
        "gripper_close_value": 0.0,
        "joint_name": ["j1", "j2", "j3", "j4", "j5", "j6"],
        "encoder_joint_topic": REQUIRED,
        "isaacsim_joint_topic": "",
        "gazebo_joint_topic": REQUIRED,
        "wmx_param_file_path": REQUIRED,
    },
    "follow_joint_trajectory_server": {
        "joint_number": 0,
        "joint_trajectory_action": REQUIRED,
        "wmx_gripper_topic": REQUIRED,
    },
    "diff_drive_controller": {
        "left_axis": 0,
        "right_axis": 1,
        "rate": 10,
        "acc_time": 1.0,
        "dec_time": 1.0,
        "wheel_radius": 0.09,
        "wheel_to_wheel": 0.55,
        "cmd_vel_topic": REQUIRED,
        "encoder_vel_topic": REQUIRED,
        "encoder_omega_topic": REQUIRED,
        "encoder_odometry_topic": REQUIRED,
        "wmx_param_file_path": REQUIRED,
    },
}
OF_THE_ROBOT = {  # their defaults are the robot's, as the page says
    "gripper_close_value",
    "joint_feedback_rate",
    "joint_name",
    "joint_number",
}


def rows(section: str) -> dict[str, str]:
    """Names in the first column → verdict, of the table in a section."""
    text = PAGE.split(f"## {section}\n")[1].split("\n## ")[0]
    cells = [
        (name, verdict)
        for names, verdict in re.findall(r"^\| (`[^|]+`) \| (\w+) \|", text, re.MULTILINE)
        for name in re.findall(r"`([^`]+)`", names)
    ]
    found = dict(cells)
    assert len(found) == len(cells), "a name is there twice"
    assert set(found.values()) <= VERDICTS
    return found


class Served:
    """Return what the nodes of all robots have: names with types, parameters with defaults."""

    def __init__(self) -> None:
        self.nodes: set[str] = set()
        self.topics: dict[str, str] = {}
        self.services: dict[str, str] = {}
        self.actions: set[str] = set()
        self.defaults: dict[tuple[str, str], Any] = {}

    def add(self, robot: str, variant: str | None) -> None:
        with made_nodes(build_robot(robot, "sim", variant)) as nodes:
            report = report_of(nodes)
            self.nodes |= {node.get_name() for node in nodes}
            self.topics |= {topic.name: topic.type for topic in report.topics}
            self.actions |= set(report.actions)
            for name, types in nodes[0].get_service_names_and_types():
                self.services[name] = types[0]


@pytest.fixture(scope="module")
def served() -> Served:
    served = Served()
    declare = Parameters._declare

    def recording(self: Parameters, name: str, reference: Any, meaning: str) -> Any:
        served.defaults[self._node.get_name(), name] = reference
        return declare(self, name, reference, meaning)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Parameters, "_declare", recording)
        for robot, variant in ROBOTS:
            served.add(robot, variant)
    return served


@pytest.mark.parametrize(
    ("section", "names"),
    [
        ("Nodes", NODES),
        ("Launch files", LAUNCH_FILES),
        ("Configuration files", set(FILES)),
        ("Services", set(SERVICES)),
        ("Topics", set(TOPICS)),
        ("Actions", {ACTION}),
        *((f"Parameters of {node}", set(names)) for node, names in PARAMETERS.items()),
    ],
)
def test_the_page_has_every_name_and_no_other(section: str, names: set[str]) -> None:
    assert set(rows(section)) == names


def test_nodes_and_action_are_served(served: Served) -> None:
    assert served.nodes >= NODES
    assert ACTION in served.actions


@pytest.mark.parametrize("name", SERVICES)
def test_services_are_served(served: Served, name: str) -> None:
    assert served.services[name] == SERVICES[name]


@pytest.mark.parametrize("name", TOPICS)
def test_topics_are_served(served: Served, name: str) -> None:
    topic, kind = TOPICS[name]
    assert served.topics[topic] == kind


@pytest.mark.parametrize(
    "path", [*(f"ros/ament/launch/{name}" for name in sorted(LAUNCH_FILES)), *FILES.values()]
)
def test_files_are_there(path: str) -> None:
    assert (ROOT / path).is_file()


@pytest.mark.parametrize(
    ("node", "name"), [(node, name) for node, names in PARAMETERS.items() for name in names]
)
def test_parameters_have_their_types_and_defaults(served: Served, node: str, name: str) -> None:
    reference, ours = PARAMETERS[node][name], served.defaults[node, name]
    assert type(ours) is type(reference)
    if name not in OF_THE_ROBOT:
        assert ours == reference
