"""Settings of the nodes that take commands of clients: joint topics and the gripper's actions."""

from __future__ import annotations

from typing import NamedTuple

from robotd.descriptor import RobotDescriptor
from robotd.node_settings.parameter_reader import ParameterReader

STATE_HZ = 50


class JointCommandSettings(NamedTuple):
    """Settings of ``joint_command_node``; a topic or service that is "" is not offered.

    Attributes:
        timeout_s: age of the last message at which the joints slow to rest.
        state_rate_hz: of the topic ``state``.
    """

    timeout_s: float
    trajectory: str
    position: str
    velocity: str
    jog: str
    state: str
    query: str
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
        parameters.topic("joint_trajectory_topic", "trajectories and single points"),
        parameters.topic("position_commands_topic", "positions of all joints"),
        parameters.topic("velocity_commands_topic", "velocities of all joints"),
        parameters.topic("joint_jog_topic", "velocities of named joints"),
        parameters.topic("controller_state_topic", "commanded and measured motion"),
        parameters.topic("query_state_service", "commanded motion at a time"),
        parameters.integer(
            "state_publish_rate", STATE_HZ, (1, highest), "rate of the state topic in Hz"
        ),
    )


def read_gripper_controller(
    parameters: ParameterReader, descriptor: RobotDescriptor
) -> GripperControllerSettings:
    """Declare the parameters of ``gripper_controller``."""
    return GripperControllerSettings(
        parameters.topic("gripper_action", "name of the GripperCommand action"),
        parameters.topic("parallel_gripper_action", "name of the ParallelGripperCommand action"),
    )
