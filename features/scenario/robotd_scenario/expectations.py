"""Evaluation of a scenario's checks against the robot."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robotd.api import Operation
from robotd.api.robots import Robot
from robotd_scenario.program import Axes, Check, Fingers

STANDSTILL = 1e-2  # rad/s or m/s


def unmet(check: Check, robot: Robot) -> str | None:
    """Describe the unmet expectations with the actual values; None: all are met."""
    return "; ".join(_findings(check, robot)) or None


def standing(robot: Robot) -> bool:
    """Return True while no axis executes a command and none moves."""
    image = robot.image
    idle = bool((image.operation == Operation.IDLE).all())
    return idle and not bool((np.abs(image.velocity) > STANDSTILL).any())


def _findings(check: Check, robot: Robot) -> Iterator[str]:
    for name, wanted in (check.joints_rad or {}).items():
        yield from _joint(robot, name, wanted, check.tolerance_rad)
    if check.engine not in (None, state := robot.connection.state):
        yield f"engine is {state.value}"
    image = robot.image
    for name, axes, flags in (
        ("servos on", check.servos_on, image.servo_on),
        ("alarms", check.alarms, image.amp_alarm),
        ("offline", check.offline, image.offline),
    ):
        yield from _axes(name, axes, flags)
    if check.standstill not in (None, now := standing(robot)):
        yield "all axes stand" if now else "an axis moves"
    if check.gripper is not None:
        yield from _gripper(robot, check.gripper)


def _joint(robot: Robot, name: str, wanted: float, tolerance: float) -> Iterator[str]:
    if name not in robot.joint_names:
        yield f"unknown joint {name!r}"
        return
    position = float(robot.image.position[robot.joint_axes[robot.joint_names.index(name)]])
    if not abs(position - wanted) <= tolerance:
        yield f"{name} is at {position:.6f} rad, not within {tolerance:g} of {wanted:g}"


def _axes(what: str, wanted: Axes | None, flags: np.ndarray) -> Iterator[str]:
    present = np.flatnonzero(flags).tolist()
    if wanted is not None and sorted(wanted) != present:
        yield f"{what}: {present or 'none'}"


def _gripper(robot: Robot, wanted: Fingers) -> Iterator[str]:
    if robot.gripper is None:
        yield f"{robot.descriptor.name} has no gripper"
        return
    closed = robot.gripper.closed
    if closed != (1.0 if wanted is Fingers.CLOSED else 0.0):
        yield f"gripper is {closed:.0%} closed"
