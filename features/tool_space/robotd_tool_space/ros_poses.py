"""Poses as messages of geometry_msgs."""

from __future__ import annotations

from typing import Any

import numpy as np

from robotd.api import FloatArray
from robotd.api.models import transform_numbers
from robotd_tool_space.rotations import quaternion_pose


def pose_of_message(message: Any) -> FloatArray:
    """Return a geometry_msgs/Pose as a matrix (4, 4). Raises InvalidArgument: it is none."""
    place, turn = message.position, message.orientation
    return quaternion_pose((place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))


def fill_pose(message: Any, pose: FloatArray) -> None:
    """Set a geometry_msgs/Pose; NaN where ``pose`` is not known."""
    numbers = transform_numbers(pose) if np.isfinite(pose).all() else np.full(7, np.nan)
    x, y, z, qx, qy, qz, qw = map(float, numbers)
    message.position.x, message.position.y, message.position.z = x, y, z
    turn = message.orientation
    turn.x, turn.y, turn.z, turn.w = qx, qy, qz, qw
