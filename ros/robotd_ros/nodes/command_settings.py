"""Settings of the nodes that take commands of clients: joint topics and the gripper's actions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from robotd.descriptor import RobotDescriptor
from robotd.descriptor.group_parameters import group_prefixes
from robotd.plugin.parameter_reader import ParameterReader

STATE_HZ = 50


class JointTopics(NamedTuple):
    """Topics and service of a joint group in ``joint_command_node``; "" is not offered."""

    trajectory: str
    position: str
    velocity: str
    effort: str
    jog: str
    state: str
    query: str


class JointCommandSettings(NamedTuple):
    """Settings of ``joint_command_node``.

    Attributes:
        timeout_s: age of the last message at which the joints slow to rest.
        topics: of each joint group.
        state_rate_hz: of the topic ``state``.
    """

    timeout_s: float
    topics: Mapping[str, JointTopics]
    state_rate_hz: int


class GripperControllerSettings(NamedTuple):
    """Names of the two actions of ``gripper_controller``; "" is not offered."""

    single: str
    parallel: str


def read_joint_command(
    parameters: ParameterReader, descriptor: RobotDescriptor
) -> JointCommandSettings:
    """Declare the parameters of ``joint_command_node``."""
    timeout_s = parameters.positive(
        "command_timeout_s",
        descriptor.stream.timeout_s,
        "age of the last message at which the joints slow to rest, in s",
    )
    highest = int(descriptor.cycle.rate_hz)
    return JointCommandSettings(
        timeout_s,
        {
            group: _joint_topics(parameters, prefix)
            for group, prefix in group_prefixes(descriptor).items()
        },
        parameters.integer(
            "state_publish_rate", STATE_HZ, (1, highest), "rate of the state topic in Hz"
        ),
    )


def _joint_topics(parameters: ParameterReader, prefix: str) -> JointTopics:
    def topic(name: str, meaning: str) -> str:
        return parameters.topic(f"{prefix}{name}", meaning)

    return JointTopics(
        topic("joint_trajectory_topic", "trajectories and single points"),
        topic("position_commands_topic", "positions of all joints"),
        topic("velocity_commands_topic", "velocities of all joints"),
        topic("effort_commands_topic", "torques of all joints, which need limits"),
        topic("joint_jog_topic", "velocities of named joints"),
        topic("controller_state_topic", "commanded and measured motion"),
        topic("query_state_service", "commanded motion at a time"),
    )


def read_gripper_controller(
    parameters: ParameterReader, descriptor: RobotDescriptor
) -> GripperControllerSettings:
    """Declare the parameters of ``gripper_controller``."""
    return GripperControllerSettings(
        parameters.topic("gripper_action", "name of the GripperCommand action"),
        parameters.topic("parallel_gripper_action", "name of the ParallelGripperCommand action"),
    )
