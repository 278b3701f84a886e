"""Parameters of goals that change at run time, named as by joint_trajectory_controller."""

from __future__ import annotations

from typing import Any

from robotd.descriptor import RobotDescriptor
from robotd.descriptor.joint_settings import JointSettings, JointType
from robotd.plugin.parameter_reader import ParameterReader

GOAL_TIME = "constraints.goal_time"  # s after the end to reach the goal; 0: without an end
END_VELOCITY = "allow_nonzero_velocity_at_trajectory_end"


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
        "pass a last point with a velocity, and brake behind it",
    )
    return values


def _defaults(joint: JointSettings, descriptor: RobotDescriptor) -> tuple[float, float]:
    """Return path and goal tolerance of the descriptor."""
    settings = descriptor.trajectory
    if joint.type is JointType.PRISMATIC:
        return settings.path_tolerance_m or 0.0, settings.goal_tolerance_m
    return settings.path_tolerance_rad or 0.0, settings.goal_tolerance_rad
