"""Settings of the nodes of an arm: joint states and trajectories."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from robotd.descriptor import RobotDescriptor
from robotd.descriptor.group_parameters import (
    ACTION_PARAMETER,
    GROUPS,
    JOINTS,
    default_action,
    group_prefixes,
)
from robotd.plugin.parameter_reader import ParameterReader
from robotd_ros.nodes.constraint_settings import read_constraints

FILE_MEANING = "parameter file; empty: the robot's"


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
    has_gripper = descriptor.gripper is not None
    gripper = parameters.topic(
        "wmx_gripper_topic", "service that closes the gripper", required=has_gripper
    )
    if gripper and not has_gripper:
        what = f"{gripper!r} is given, but {descriptor.name} has no gripper"
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
