"""Settings of ``servo_node`` and ``wmx_robot_option_node``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from robotd.api import ParameterReader, RobotDescriptor
from robotd_ros.nodes.device_settings import read_frame_prefix
from robotd_tool_space.streams.tool_twist_limits import ToolTwistLimits

DEFAULT = ToolTwistLimits()
STATUS_HZ, MAX_STATUS_HZ = 10.0, 100.0
MAX_ID = 2**31 - 1


class ServoTopics(NamedTuple):
    """Topics of a joint group."""

    twist: str
    pose: str
    status: str
    message: str


class ServoSettings(NamedTuple):
    """Settings of ``servo_node``.

    Attributes:
        timeout_s: age of the last message at which the tool slows to rest.
        limits: of the tool.
        topics: of each joint group.
    """

    timeout_s: float
    limits: ToolTwistLimits
    topics: Mapping[str, ServoTopics]


def read_servo(parameters: ParameterReader, descriptor: RobotDescriptor) -> ServoSettings:
    """Declare the parameters of ``servo_node``."""
    timeout_s = parameters.positive(
        "command_timeout_s",
        descriptor.stream.timeout_s,
        "age of the last message at which the tool slows to rest, in s",
    )
    limits = ToolTwistLimits(
        parameters.positive("linear_speed_m_s", DEFAULT.linear_m_s, "highest speed of the tool"),
        parameters.positive(
            "angular_speed_rad_s", DEFAULT.angular_rad_s, "highest angular speed of the tool"
        ),
        parameters.positive(
            "linear_acceleration_m_s2", DEFAULT.linear_m_s2, "highest acceleration of the tool"
        ),
        parameters.positive(
            "angular_acceleration_rad_s2",
            DEFAULT.angular_rad_s2,
            "highest angular acceleration of the tool",
        ),
    )
    topics = {}
    for group in descriptor.joint_groups:
        prefix = f"~/{group}" if descriptor.groups else "~"
        topics[group] = ServoTopics(
            f"{prefix}/delta_twist_cmds",
            f"{prefix}/pose_target_cmds",
            f"{prefix}/status",
            f"{prefix}/status_message",
        )
    return ServoSettings(timeout_s, limits, topics)


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
