"""Units of WMX R2: mm and degrees, and poses as x, y, z and roll, pitch, yaw (u, v, w)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robotd.api import FloatArray, InvalidArgument
from robotd_tool_space.rotations import pose_of, rpy_of

MM_M = 1e-3
FACTORS = {"rad": np.pi / 180.0, "m": MM_M}


def pose_of_r2(message: Any) -> FloatArray:
    """Return a RobotCartesianPose as a pose (4, 4), m. Raises InvalidArgument: not finite."""
    for component in "xyzuvw":
        if not np.isfinite(value := getattr(message, component)):
            raise InvalidArgument(f"{component} of the pose is {value}, must be a finite number")
    place = np.array([message.x, message.y, message.z])
    return pose_of(MM_M * place, np.radians([message.u, message.v, message.w]))


def fill_r2_pose(message: Any, pose: FloatArray) -> None:
    """Set a RobotCartesianPose to a pose (4, 4), m. At a pitch of a quarter turn u is 0."""
    message.x, message.y, message.z = map(float, pose[:3, 3] / MM_M)
    message.u, message.v, message.w = map(float, np.degrees(rpy_of(pose)))


def r2_factors(units: Sequence[str]) -> FloatArray:
    """Return what a degree or mm of each joint is, (n,), in its unit, rad or m."""
    return np.array([FACTORS[unit] for unit in units])


def joints_of_r2(values: Sequence[float], names: Sequence[str], factors: FloatArray) -> FloatArray:
    """Return positions (n,), rad or m, of values in degrees or mm.

    Args:
        values: one for each joint.
        names: of the joints.
        factors: see ``r2_factors``.

    Raises InvalidArgument: another number of values, or one that is not finite.
    """
    if len(values) != len(names):
        raise InvalidArgument(f"target_joint has {len(values)} values for {len(names)} joints")
    for name, value in zip(names, values, strict=True):
        if not np.isfinite(value):
            raise InvalidArgument(f"target_joint of {name} is {value}, must be a finite number")
    return np.array(values) * factors
