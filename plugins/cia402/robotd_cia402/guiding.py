"""Hand guiding by torque: drives carry the weight of their joints, and damp their motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from robotd.api import (
    GravityModel,
    NotReady,
    Operation,
    RobotDescriptor,
    Unsupported,
    get_logger,
    read_urdf,
)
from robotd_cia402.axis import Axis
from robotd_cia402.object_numbers import MODE, MODE_DISPLAY, POSITION, TARGET_TORQUE, TORQUE
from robotd_cia402.options import DriveOptions
from robotd_cia402.silent_drive import MAX_MISSED

log = get_logger("cia402")

GUIDING_KEY = "guiding_damping_nm_s_rad"
GUIDING_OUTPUTS = {MODE: "modes of operation", TARGET_TORQUE: "target torque"}
GUIDING_INPUTS = {MODE_DISPLAY: "mode display", POSITION: "position", TORQUE: "torque"}
"""Objects that the cyclic frames of a guided axis hold, with their names."""
MAX_UNWATCHED_S = 1.0
"""Longest time after which a guided drive has to stop by itself when robotd is lost."""
_BEGIN_S = 0.2  # time constant with which the torque at the start becomes that of the model


class HandGuiding:
    """Torques of the joints that are guided by hand.

    Each gets the torque of the weight that it carries, less its damping times its measured
    velocity, within its limit of the torque. The weight follows from the positions of all joints:
    where one is not known any more, all guided joints stop.

    Args:
        model: of the weight; joints as in ``joints``.
        joints: axes of the robot's joints.
        limits: highest torque of each, N·m or N; None where it is not guided.
    """

    def __init__(
        self, model: GravityModel, joints: Sequence[Axis[Any]], limits: Sequence[float | None]
    ) -> None:
        self._model, self._joints = model, joints
        self._limits = [limit or 0.0 for limit in limits]
        self._excess: dict[int, float] = {}  # beyond the model's torque, by guided axis

    def require_carried(self, axes: Sequence[int]) -> None:
        """Require drives that can carry ``axes`` and that stop by themselves. Worker.

        Raises:
            Unsupported: an axis is not guided, by the robot's file.
            NotReady: a position is not known, a drive would keep its torque when robotd or the
                cable is lost, or a weight is beyond the limit.
        """
        if reason := self._unknown():
            raise NotReady(reason)
        weights = dict(zip([axis.number for axis in self._joints], self._weights(), strict=True))
        limits = dict(zip(weights, self._limits, strict=True))
        by_number = {axis.number: axis for axis in self._joints}
        for number in axes:
            axis = by_number.get(number)
            if axis is None or not is_guided(axis.options):
                raise Unsupported(f"hand guiding of axis {number}")
            node = axis.drive.node
            if reason := node.unwatched or axis.drive.unreacting:
                text = "it would keep its torque when robotd or the cable is lost"
                raise NotReady(f"{node.label}: {text}: {reason}", axis=number)
            if abs(weights[number]) > limits[number]:
                text = f"its weight takes {abs(weights[number]):.3g} N·m (or N)"
                text = f"{node.label}: {text}, its limit is {limits[number]:g}"
                raise NotReady(text, axis=number)

    def advance(self, period_s: float) -> None:
        """Control loop: set the torques of the next frame."""
        guided = [a for a in self._joints if a.activity.operation is Operation.GUIDING]
        if not guided:
            self._excess.clear()
            return
        if reason := self._unknown():
            log.error("hand guiding ends", reason=reason)
            for axis in guided:
                axis.brake(axis.options.stop_deceleration_rad_s2)
            return
        for axis, weight, limit in zip(self._joints, self._weights(), self._limits, strict=True):
            if axis not in guided:
                self._excess.pop(axis.number, None)
                continue
            damping = axis.options.guiding_damping_nm_s_rad or 0.0
            torque = weight - damping * axis.report.velocity
            excess = self._excess.get(axis.number, axis.setpoint.torque - torque)
            self._excess[axis.number] = excess * max(0.0, 1.0 - period_s / _BEGIN_S)
            axis.carry(min(max(torque + excess, -limit), limit))

    def _weights(self) -> list[float]:
        positions = np.array([axis.report.position for axis in self._joints])
        weights: list[float] = self._model.torques(positions).tolist()
        return weights

    def _unknown(self) -> str:
        """Return which joint's position is not known; "": all are."""
        for axis in self._joints:
            drive = axis.drive
            if not axis.report.known:
                return f"{drive.node.name}: {drive.node.fault or drive.awaited}"
            if drive.missed >= MAX_MISSED or drive.blocked:
                return f"{drive.node.name}: {drive.missed} frames without an answer"
        return ""


def is_guided(options: DriveOptions) -> bool:
    """Return whether an axis can be guided by hand."""
    return options.guiding_damping_nm_s_rad is not None


def make_guiding(robot: RobotDescriptor, axes: Sequence[Axis[Any]]) -> HandGuiding | None:
    """Return the hand guiding of a robot; None where no axis has a damping for it."""
    if robot.urdf is None or not any(is_guided(axis.options) for axis in axes):
        return None
    model = GravityModel(read_urdf(robot.urdf), [joint.name for joint in robot.joints])
    joints = [axes[joint.axis] for joint in robot.joints]
    return HandGuiding(model, joints, [joint.effort_limit for joint in robot.joints])


def guiding_problems(
    robot: RobotDescriptor, drives: Sequence[DriveOptions]
) -> Iterator[tuple[int, str]]:
    """Yield what axes lack that are to be guided, each with its place in ``drives``.

    Raises DescriptorError: the URDF cannot be read.
    """
    guided = [place for place, drive in enumerate(drives) if is_guided(drive)]
    if not guided:
        return
    if robot.urdf is None:
        yield guided[0], "hand guiding takes the masses of a URDF: give the robot's file the urdf"
        return
    joints = {joint.axis: joint for joint in robot.joints}
    model = GravityModel(read_urdf(robot.urdf), [joint.name for joint in robot.joints])
    if links := model.massless:
        yield guided[0], f"hand guiding takes the masses of all links; none has {', '.join(links)}"
    for place in guided:
        joint = joints.get(drives[place].axis)
        if joint is None:
            yield place, f"axis {drives[place].axis} is no joint, and cannot be guided by hand"
            continue
        turns = joint.unit == "rad"
        if joint.rated_effort is None:
            key = "rated_torque_nm" if turns else "rated_force_n"
            yield place, f"hand guiding takes the {key} of {joint.name}: torques are parts of it"
        if joint.effort_limit is None:
            key = "torque_limit_nm" if turns else "force_limit_n"
            yield place, f"hand guiding takes the {key} of {joint.name}: it bounds the torque"
