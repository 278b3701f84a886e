"""Angles of rotations, as commands show and take them. Needs no ROS, for a quick start."""

from __future__ import annotations

import math


def roll_pitch_yaw(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    """Return the angles of a quaternion about fixed x, y and z, rad, as ``rpy`` of a URDF.

    With a pitch of ±π/2 roll and yaw turn about the same axis: roll is 0 then.
    """
    sine = max(-1.0, min(1.0, 2.0 * (w * y - z * x)))
    pitch = math.asin(sine)
    if abs(sine) > 1.0 - 1e-12:
        return 0.0, pitch, -2.0 * math.copysign(1.0, sine) * math.atan2(x, w)
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return roll, pitch, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
