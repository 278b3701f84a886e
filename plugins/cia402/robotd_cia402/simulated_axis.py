"""Model of a simulated drive axis from the options of a robot's axis."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from robotd.api import FloatArray, GravityModel, RobotDescriptor, read_urdf
from robotd_cia402.guiding import is_guided
from robotd_cia402.options import DriveOptions
from robotd_cia402.simulated import DriveModel, Scale, Switches

_RATED_NM = 100.0  # where the descriptor has no rated torque


def drive_model(motor: int, axis: DriveOptions, rated_torque_nm: float | None) -> DriveModel:
    """Return the simulated axis that ``axis`` describes.

    Args:
        motor: its number in the ``Motors`` of the simulation.
        rated_torque_nm: N·m (or N) of the joint; None: 100.
    """
    counts = axis.counts_per_rad
    scale = Scale(
        counts,
        axis.velocity_per_rad_s or counts,
        axis.acceleration_per_rad_s2 or counts,
        axis.polarity,
    )
    rated_nm = rated_torque_nm or _RATED_NM
    return DriveModel(motor, scale, axis.axis_offset, rated_nm, _switches(axis))


def initial_positions(axes: Sequence[DriveOptions], robot: RobotDescriptor) -> list[float]:
    """Return the positions at power-on: as given, or inside the limits of the joints."""
    initial = {joint.axis: joint.initial_position for joint in robot.joints}
    given = [(axis.simulated_position_rad, initial.get(axis.axis, 0.0)) for axis in axes]
    return [position if known is None else known for known, position in given]


def joint_weights(
    axes: Sequence[DriveOptions], robot: RobotDescriptor
) -> Callable[[FloatArray], FloatArray] | None:
    """Return what ``Motors`` carry of a robot that is guided by hand; None: of another one."""
    if robot.urdf is None or not any(is_guided(axis) for axis in axes):
        return None
    motor = {axis.axis: number for number, axis in enumerate(axes)}
    joints = [joint for joint in robot.joints if joint.axis in motor]
    model = GravityModel(read_urdf(robot.urdf), [joint.name for joint in joints])
    columns = [motor[joint.axis] for joint in joints]

    def weights(positions: FloatArray) -> FloatArray:
        found = np.zeros(len(axes))
        found[columns] = model.torques(positions[columns])
        return found

    return weights


def _switches(axis: DriveOptions) -> Switches:
    """Convert the switches from the direction of the joint to that of the drive."""
    given = axis.simulated_switches
    ends = given.negative_limit_rad, given.positive_limit_rad
    if axis.polarity > 0:
        return Switches(*ends, given.home_rad, given.home_width_rad)
    low, high, home = (None if one is None else -one for one in (*reversed(ends), given.home_rad))
    return Switches(low, high, home, given.home_width_rad)
