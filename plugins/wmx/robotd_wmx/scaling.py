"""User units and percent ↔ SI. Counts, gear ratios and polarity stay inside the engine."""

from __future__ import annotations

import numpy as np

from robotd.api import DescriptorError, FloatArray, Profile, RobotDescriptor
from robotd_wmx.options import WmxOptions

UNLIMITED = 10.0  # rad/s or m/s, stands for a missing velocity limit


class Scaling:
    """Scale of n axes.

    Attributes:
        units: user units per rad or m, (n,).
        si: its inverse.
        torque: N·m per percent of the rated torque, (n,); NaN where that is not known.
        velocity: limit in rad/s or m/s, (n,); 10 where there is none.
        moved_axes: those of joints and wheels.
        stop_deceleration: of a controlled stop, rad/s² or m/s², (n,).
    """

    def __init__(self, robot: RobotDescriptor, options: WmxOptions) -> None:
        units = np.asarray(options.units_per_si, np.float64)
        if units.ndim and units.shape != (robot.axes,):
            message = (
                f"has {units.size} figures, the robot has {robot.axes} axes, 0 to {robot.axes - 1}"
            )
            raise DescriptorError(message, key="backends.wmx.units_per_si")
        self.units: FloatArray = np.broadcast_to(units, (robot.axes,)).copy()
        self.si: FloatArray = 1.0 / self.units
        self.torque: FloatArray = np.full(robot.axes, np.nan)
        ramps = [ramp or options.stop_deceleration_rad_s2 for ramp in robot.stop_decelerations]
        self.stop_deceleration: FloatArray = np.array(ramps)
        self.velocity: FloatArray = np.full(robot.axes, UNLIMITED)
        self.moved_axes = [joint.axis for joint in robot.joints]
        for joint in robot.joints:
            self.velocity[joint.axis] = min(joint.velocity, UNLIMITED)
            if joint.rated_effort is not None:
                self.torque[joint.axis] = joint.rated_effort / 100.0
        if robot.drive:
            self.moved_axes += robot.drive.axes

    def profile(self, axis: int, profile: Profile) -> tuple[float, float, float]:
        """Velocity, acceleration and deceleration in user units."""
        scale = float(self.units[axis])
        return profile.velocity * scale, profile.acceleration * scale, profile.deceleration * scale
