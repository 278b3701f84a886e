"""Settings of ``wmx_robot_option_node``."""

from __future__ import annotations

from typing import NamedTuple

from robotd.api import ParameterReader, RobotDescriptor
from robotd_ros.nodes.device_settings import read_frame_prefix

STATUS_HZ, MAX_STATUS_HZ = 10.0, 100.0
MAX_ID = 2**31 - 1


class RobotOptionSettings(NamedTuple):
    """Settings of ``wmx_robot_option_node``.

    Attributes:
        robot_id: number that clients name the robot by.
        group: joint group that is the robot; "" for the only one.
        status_hz: rate of the status.
        prefix: of the name of its frame.
    """

    robot_id: int
    group: str
    status_hz: float
    prefix: str


def read_robot_option(
    parameters: ParameterReader, descriptor: RobotDescriptor
) -> RobotOptionSettings:
    """Declare the parameters of ``wmx_robot_option_node``."""
    groups = list(descriptor.joint_groups)
    default = groups[0] if descriptor.groups else ""
    group = parameters.text("group", default, "joint group that is the robot")
    if group != default and group not in groups:
        parameters.reject("group", f"{group!r} is none of {', '.join(groups)}")
    status_hz = parameters.positive(
        "robot_status_rate", STATUS_HZ, f"rate of the status in Hz; at most {MAX_STATUS_HZ:g}"
    )
    if status_hz > MAX_STATUS_HZ:
        parameters.reject("robot_status_rate", f"{status_hz:g} is above {MAX_STATUS_HZ:g}")
    return RobotOptionSettings(
        parameters.integer("robot_id", 0, (0, MAX_ID), "number that clients name the robot by"),
        group,
        status_hz,
        read_frame_prefix(parameters),
    )
