"""Settings of ``servo_node``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from robotd.api import ParameterReader, RobotDescriptor
from robotd_tool_space.twist_limits import TwistLimits

DEFAULT = TwistLimits()


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
    limits: TwistLimits
    topics: Mapping[str, ServoTopics]


def read_servo(parameters: ParameterReader, descriptor: RobotDescriptor) -> ServoSettings:
    """Declare the parameters of ``servo_node``."""
    timeout_s = parameters.positive(
        "command_timeout_s",
        descriptor.stream.timeout_s,
        "age of the last message at which the tool slows to rest, in s",
    )
    limits = TwistLimits(
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
