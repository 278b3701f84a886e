"""Settings of the built-in ROS nodes, read from their parameters; without ROS.

The same functions read them where ROS is not there (``robotd check``) and where a node declares
its parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from robotd.descriptor import RobotDescriptor
from robotd.errors import DescriptorError
from robotd_ros.node_settings.arm_settings import read_manipulator_state, read_trajectory_server
from robotd_ros.node_settings.base_settings import (
    read_diff_drive,
    read_mecanum_drive,
    read_tricycle,
)
from robotd_ros.node_settings.command_settings import read_gripper_controller, read_joint_command
from robotd_ros.node_settings.device_settings import (
    read_core_motion,
    read_engine,
    read_state_publisher,
)
from robotd_ros.node_settings.parameter_reader import ParameterReader

_READERS: Mapping[str, Callable[[ParameterReader, RobotDescriptor], object]] = {
    "wmx_engine_node": read_engine,
    "wmx_core_motion_node": read_core_motion,
    "manipulator_state": read_manipulator_state,
    "follow_joint_trajectory_server": read_trajectory_server,
    "diff_drive_controller": read_diff_drive,
    "mecanum_drive_controller": read_mecanum_drive,
    "tricycle_controller": read_tricycle,
    "joint_command_node": read_joint_command,
    "gripper_controller": read_gripper_controller,
    "robot_state_publisher": read_state_publisher,
}


def check_node_parameters(descriptor: RobotDescriptor, built_in: Collection[str]) -> None:
    """Check the section ``ros_parameters`` of the robot's built-in nodes.

    Args:
        descriptor: of the robot.
        built_in: names of robotd's own nodes; those of plugins declare what they like.

    Raises DescriptorError that lists missing, unknown and wrong parameters with file and line.
    """
    problems: list[DescriptorError] = []
    for name in descriptor.nodes:
        if name in built_in:
            reader = ParameterReader(name, descriptor)
            try:
                if name in _READERS:
                    _READERS[name](reader, descriptor)
            except DescriptorError as error:
                problems.append(error)
            problems += reader.problems()
    if problems:
        raise DescriptorError.join(problems)
