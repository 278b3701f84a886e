"""Joint groups of a robot: which one is meant, its limits, and motion of it to its end."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from robotd.api import (
    FloatArray,
    InvalidArgument,
    NotReady,
    OperationError,
    unknown_name,
    wait_until,
)
from robotd.api.robots import JointGroup, JointLimits, Outcome, Robot, TrajectoryRequest

WAIT_S = 60.0  # of one wait in a loop without an end
POLL_S = 0.01
ROUNDING = 1e-6  # rad or m beyond a limit, as in the check of a trajectory


def joint_group(robot: Robot, name: str) -> JointGroup:
    """Return a joint group; "": the only one. Raises InvalidArgument."""
    groups = {key: group for key, group in robot.groups.items() if group.joint_names}
    if not groups:
        raise InvalidArgument(f"{robot.descriptor.name} has no joints")
    if not name and len(groups) > 1:
        raise InvalidArgument(f"name one of the joint groups {', '.join(groups)}")
    if name and name not in groups:
        raise InvalidArgument(unknown_name("joint group", name, groups))
    return groups[name] if name else next(iter(groups.values()))


def group_of(robot: Robot, joints: Collection[str]) -> JointGroup:
    """Return the group that has exactly ``joints``. Raises InvalidArgument: none has."""
    found = list(robot.groups.values())
    for group in found:
        if group.joint_names and set(group.joint_names) == set(joints):
            return group
    own = {joint for group in found for joint in group.joint_names}
    if unknown := [joint for joint in joints if joint not in own]:
        raise InvalidArgument(f"the robot has no joint {', '.join(unknown)}")
    raise InvalidArgument(f"{', '.join(joints)} are not all joints of one group")


def beyond_limits(limits: JointLimits, positions: FloatArray) -> str:
    """Return which joint one of positions (n,) or (k, n) takes out of its limits; "": none."""
    rows = np.atleast_2d(positions)
    below, above = rows < limits.lower - ROUNDING, rows > limits.upper + ROUNDING
    outside = np.argwhere(below | above).tolist()
    if not outside:
        return ""
    (row, joint), *_ = outside
    low, high, unit = limits.lower[joint], limits.upper[joint], limits.units[joint]
    at = f"{limits.names[joint]} would be at {rows[row, joint]:.6g} {unit}"
    return f"{at}, its limits are {low:g} to {high:g} {unit}"


def measured_positions(robot: Robot, group: JointGroup) -> FloatArray:
    """Return the positions (n,) of the joints. Raises NotReady: they are not known."""
    positions: FloatArray = robot.image.copy().position[list(group.joint_axes)]
    if not np.isfinite(positions).all():
        raise NotReady("the positions of the joints are not known")
    return positions


def commands_at_rest(robot: Robot, group: JointGroup) -> FloatArray:
    """Return the commanded positions (n,) of joints that rest, from which motion begins.

    Raises NotReady: they move, or that is not known.
    """
    if group.motion.moving or group.moved_by_device(robot.image.copy()):
        raise NotReady("the joints move")
    positions = group.motion.command()
    if not np.isfinite(positions).all():
        raise NotReady("the positions of the joints are not known")
    return positions


def follow(robot: Robot, group: JointGroup, request: TrajectoryRequest, what: str) -> None:
    """Execute a trajectory and return at rest at its end.

    ``what``: of the motion, for the error.

    Raises:
        NotReady, TrajectoryRejected: the joints cannot be commanded; nothing has moved.
        OperationError: the motion ended elsewhere, with the reason.
    """
    with group.follower.follow(request) as execution:
        while not wait_until(lambda: execution.outcome is not None, WAIT_S, robot.clock, POLL_S):
            pass
        outcome, message = execution.outcome, execution.message
    if outcome is not Outcome.SUCCEEDED:
        raise OperationError(f"the motion {what} ended early: {message}")
