"""Parameters of goals that change at run time, named as by joint_trajectory_controller."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from robotd.descriptor import RobotDescriptor
from robotd.descriptor.joint_settings import JointSettings, JointType
from robotd.node_settings.parameter_reader import ParameterReader

GOAL_TIME = "constraints.goal_time"
END_VELOCITY = "allow_nonzero_velocity_at_trajectory_end"


class Constraints(NamedTuple):
    """Values by parameter, and the tolerances that they mean.

    Attributes:
        values: of ``constraints``; 0: not checked, as joint_trajectory_controller has it.
        end_velocity: a last point may have a velocity.
    """

    values: Mapping[str, float]
    end_velocity: bool

    def path(self, joint: str) -> float:
        """Return the path tolerance of ``joint``, rad or m; inf: not checked."""
        return self._limit(path_name(joint))

    def goal(self, joint: str) -> float:
        """Return the goal tolerance of ``joint``, rad or m; inf: not checked."""
        return self._limit(goal_name(joint))

    @property
    def goal_time_s(self) -> float:
        """Time after the end to reach the goal, s; inf: without an end."""
        return self._limit(GOAL_TIME)

    def _limit(self, name: str) -> float:
        return self.values[name] or math.inf


def path_name(joint: str) -> str:
    """Return the name of the parameter."""
    return f"constraints.{joint}.trajectory"


def goal_name(joint: str) -> str:
    """Return the name of the parameter."""
    return f"constraints.{joint}.goal"


def read_constraints(parameters: ParameterReader, descriptor: RobotDescriptor) -> Constraints:
    """Declare the parameters, which follow those of ``trajectory`` in the descriptor."""
    values: dict[str, float] = {}
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
    end_velocity = parameters.settable_flag(
        END_VELOCITY,
        descriptor.trajectory.allow_nonzero_velocity_at_trajectory_end,
        "pass a last point with a velocity, and brake behind it",
    )
    return Constraints(values, end_velocity)


def _defaults(joint: JointSettings, descriptor: RobotDescriptor) -> tuple[float, float]:
    """Return path and goal tolerance of the descriptor."""
    settings = descriptor.trajectory
    if joint.type is JointType.PRISMATIC:
        return settings.path_tolerance_m or 0.0, settings.goal_tolerance_m
    return settings.path_tolerance_rad or 0.0, settings.goal_tolerance_rad
