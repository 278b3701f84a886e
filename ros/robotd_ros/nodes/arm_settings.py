"""Settings of the nodes of an arm: joint states, trajectories, commands of clients, the gripper."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from robotd.descriptor import RobotDescriptor
from robotd.descriptor.joint_settings import JointSettings, JointType
from robotd.plugin.parameter_reader import ParameterReader
from robotd_ros.group_parameters import (
    ACTION_PARAMETER,
    GROUPS,
    JOINTS,
    default_action,
    group_prefixes,
)

FILE_MEANING = "parameter file; empty: the robot's"
GOAL_TIME = "constraints.goal_time"  # s after the end to reach the goal; 0: without an end
END_VELOCITY = "allow_nonzero_velocity_at_trajectory_end"
STATE_HZ = 50


class ManipulatorStateSettings(NamedTuple):
    """Settings of ``manipulator_state``; a topic that is "" is not published.

    Attributes:
        rate_hz: of the joint topics.
        names: of the joints, then of the gripper's fingers.
        open_m, closed_m: positions of the gripper at its two ends.
        joint_states, unstamped, positions: topics.
        parameters_file: None: the robot's own.
        description: URDF to publish; "" for none.
    """

    rate_hz: int
    names: tuple[str, ...]
    open_m: float
    closed_m: float
    joint_states: str
    unstamped: str
    positions: str
    parameters_file: Path | None
    description: str


class TrajectoryServerSettings(NamedTuple):
    """Settings of ``follow_joint_trajectory_server``.

    Attributes:
        actions: name of the action of each joint group.
        gripper: name of the gripper's service, "" for none.
        constraints: parameters of goals that change at run time, by name.
    """

    actions: Mapping[str, str]
    gripper: str
    constraints: Mapping[str, Any]


def read_manipulator_state(
    parameters: ParameterReader, descriptor: RobotDescriptor
) -> ManipulatorStateSettings:
    """Declare the parameters of ``manipulator_state``."""
    _declare_joints(parameters, descriptor)
    gripper = descriptor.gripper
    joints = [joint.name for joint in descriptor.joints]
    names = (*joints, *(gripper.joints if gripper else ()))
    parameters.same_as("joints", "joint_name", names, "names of the joints, then the fingers")
    highest = int(descriptor.cycle.rate_hz)
    open_m, closed_m = (
        parameters.number(
            f"gripper_{name}_value", value, f"position of the gripper {meaning}, in m"
        )
        for name, value, meaning in (
            ("open", gripper.open_m if gripper else 0.0, "when open"),
            ("close", gripper.closed_m if gripper else 0.0, "when closed"),
        )
    )
    if gripper and open_m == closed_m:
        parameters.reject("gripper_close_value", f"{closed_m} must differ from gripper_open_value")
    return ManipulatorStateSettings(
        parameters.integer(
            "joint_feedback_rate", highest, (1, highest), "rate of the joint topics in Hz"
        ),
        names,
        open_m,
        closed_m,
        parameters.topic("encoder_joint_topic", "topic of the joint states", required=True),
        parameters.topic("isaacsim_joint_topic", "copy without time stamp"),
        parameters.topic("gazebo_joint_topic", "positions as a bare array"),
        parameters.file("wmx_param_file_path", FILE_MEANING),
        parameters.description(),
    )


def read_trajectory_server(
    parameters: ParameterReader, descriptor: RobotDescriptor
) -> TrajectoryServerSettings:
    """Declare the parameters of ``follow_joint_trajectory_server``."""
    _declare_joints(parameters, descriptor)
    _declare_groups(parameters, descriptor)
    actions = {
        group: parameters.action(
            f"{prefix}{ACTION_PARAMETER}", "name of the action", default_action(descriptor, group)
        )
        for group, prefix in group_prefixes(descriptor).items()
    }
    has_output = descriptor.gripper is not None
    gripper = parameters.topic(
        "wmx_gripper_topic", "service that closes the gripper", required=has_output
    )
    if gripper and not has_output and len(descriptor.servo_grippers) != 1:
        count = "several grippers" if descriptor.servo_grippers else "no gripper"
        what = f"{gripper!r} is given, but {descriptor.name} has {count}"
        parameters.reject("wmx_gripper_topic", what)
    return TrajectoryServerSettings(actions, gripper, read_constraints(parameters, descriptor))


def _declare_joints(parameters: ParameterReader, descriptor: RobotDescriptor) -> None:
    """Declare ``joint_number`` and ``joint_units``, for clients to read."""
    if not descriptor.joints:
        parameters.reject("joint_number", f"{descriptor.name} has no joints")
    parameters.same_as("joints", "joint_number", len(descriptor.joints), "number of joints")
    units = [joint.unit for joint in descriptor.joints]
    parameters.same_as("joints", "joint_units", units, "rad or m for each joint")


def _declare_groups(parameters: ParameterReader, descriptor: RobotDescriptor) -> None:
    """Declare the groups and their joints, for clients to read; none where none is named."""
    if not descriptor.groups:
        return
    parameters.same_as("groups", GROUPS, list(descriptor.groups), "joint groups")
    for name, group in descriptor.groups.items():
        parameters.same_as(
            f"groups.{name}.joints", f"{name}.{JOINTS}", group.joints, "joints of the group"
        )


def path_name(joint: str) -> str:
    """Return the name of the path tolerance of ``joint``, rad or m; 0: not checked."""
    return f"constraints.{joint}.trajectory"


def goal_name(joint: str) -> str:
    """Return the name of the goal tolerance of ``joint``, rad or m; 0: not checked."""
    return f"constraints.{joint}.goal"


def read_constraints(parameters: ParameterReader, descriptor: RobotDescriptor) -> dict[str, Any]:
    """Declare the parameters, which follow those of ``trajectory`` in the descriptor.

    Returns their values by name; all but ``END_VELOCITY``, a bool, are tolerances.
    """
    values: dict[str, Any] = {}
    for joint in descriptor.joints:
        path, goal = _defaults(joint, descriptor)
        for name, default, meaning in (
            (path_name(joint.name), path, "error on the way that aborts a goal"),
            (goal_name(joint.name), goal, "error at the end that is success"),
        ):
            values[name] = parameters.settable(name, default, f"{meaning}, in {joint.unit}")
    values[GOAL_TIME] = parameters.settable(
        GOAL_TIME, descriptor.trajectory.goal_time_s, "time after the end to reach the goal, in s"
    )
    values[END_VELOCITY] = parameters.settable_flag(
        END_VELOCITY,
        descriptor.trajectory.allow_nonzero_velocity_at_trajectory_end,
        "pass a last point with a velocity, and brake after it",
    )
    return values


def _defaults(joint: JointSettings, descriptor: RobotDescriptor) -> tuple[float, float]:
    """Return path and goal tolerance of the descriptor."""
    settings = descriptor.trajectory
    if joint.type is JointType.PRISMATIC:
        return settings.path_tolerance_m or 0.0, settings.goal_tolerance_m
    return settings.path_tolerance_rad or 0.0, settings.goal_tolerance_rad


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


class GripperActions(NamedTuple):
    """Names of the two actions of a gripper; "" is not offered."""

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
) -> Mapping[str, GripperActions]:
    """Declare the parameters of ``gripper_controller``; return the actions by gripper.

    "" is the gripper on an output. The parameters of the only gripper have no prefix.
    """
    servos = list(descriptor.servo_grippers)
    prefixes = {"": ""} if descriptor.gripper is not None or not servos else {}
    is_only = len(servos) == 1 and not prefixes
    prefixes |= {name: "" if is_only else f"{name}." for name in servos}
    return {
        name: GripperActions(
            parameters.topic(f"{prefix}gripper_action", "name of the GripperCommand action"),
            parameters.topic(
                f"{prefix}parallel_gripper_action", "name of the ParallelGripperCommand action"
            ),
        )
        for name, prefix in prefixes.items()
    }
