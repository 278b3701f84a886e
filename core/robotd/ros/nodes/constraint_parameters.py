"""Parameters of goals that ``ros2 param set`` changes for the next goal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node

from robotd.control.joint_group import JointGroups
from robotd.log import get_logger
from robotd.node_settings.constraint_settings import END_VELOCITY, Constraints

log = get_logger("trajectory")


class ConstraintParameters:
    """Applies the settable parameters to the goals that are accepted from then on.

    Executor thread.

    Args:
        node: has declared the parameters.
        groups: of the joints.
        constraints: values at the start.
    """

    def __init__(self, node: Node, groups: JointGroups, constraints: Constraints) -> None:
        self._groups = groups
        self._values: dict[str, Any] = {
            **constraints.values,
            END_VELOCITY: constraints.end_velocity,
        }
        self._apply()
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._changed)

    def _check(self, parameters: Sequence[Any]) -> SetParametersResult:
        for each in parameters:
            value = each.value
            is_tolerance = each.name in self._values and each.name != END_VELOCITY
            if is_tolerance and not (math.isfinite(value) and value >= 0.0):
                what = f"{each.name}: {value} is not a finite number of at least 0"
                return SetParametersResult(successful=False, reason=what)
        return SetParametersResult(successful=True)

    def _changed(self, parameters: Sequence[Any]) -> None:
        changed = {each.name: each.value for each in parameters if each.name in self._values}
        if changed:
            self._values.update(changed)
            self._apply()
            log.info("settings of goals changed", **changed)

    def _apply(self) -> None:
        constraints = Constraints(self._values, self._values[END_VELOCITY])
        for group in self._groups.values():
            names = group.joint_names
            group.follower.allow_end_velocity(constraints.end_velocity)
            group.follower.set_default_tolerances(
                [constraints.path(name) for name in names],
                [constraints.goal(name) for name in names],
                constraints.goal_time_s,
            )
