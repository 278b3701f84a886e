"""Rotations and poses: matrices, rotation vectors, roll-pitch-yaw and quaternions.

Poses are matrices of shape (4, 4), m. Functions of "..." take any number of leading dimensions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robotd.api import FloatArray, InvalidArgument, did_you_mean
from robotd.api.models import frame, transform_numbers

HALF_TURN_COSINE = -0.9999  # beyond it the skew part of a matrix has no direction left
SMALLEST_RAD = 1e-12  # of a rotation; one below it is as good as none
IDENTITY = np.eye(3)
COMPONENTS = ("x", "y", "z", "roll", "pitch", "yaw")
ROTATION_TOLERANCE = 1e-6  # of a given matrix: R·Rᵀ against the identity


def skew(vectors: FloatArray) -> FloatArray:
    """Return the matrices of cross products, (..., 3, 3) of vectors (..., 3)."""
    result = np.zeros((*vectors.shape, 3))
    result[..., 0, 1], result[..., 0, 2] = -vectors[..., 2], vectors[..., 1]
    result[..., 1, 0], result[..., 1, 2] = vectors[..., 2], -vectors[..., 0]
    result[..., 2, 0], result[..., 2, 1] = -vectors[..., 1], vectors[..., 0]
    return result


def rotation_matrices(vectors: FloatArray) -> FloatArray:
    """Return the matrices (..., 3, 3) of rotation vectors (..., 3), rad: Rodrigues' formula."""
    angle = np.sqrt((vectors * vectors).sum(axis=-1))[..., None, None]
    cross = skew(vectors)
    # sin(a)/a and (1 - cos a)/a² without a division by 0; NumPy's sinc takes twice as long.
    size = np.maximum(angle, SMALLEST_RAD)
    first = np.where(angle > SMALLEST_RAD, np.sin(angle) / size, 1.0)
    half = np.where(angle > SMALLEST_RAD, np.sin(0.5 * angle) / size, 0.5)
    matrices: FloatArray = IDENTITY + first * cross + 2.0 * half * half * (cross @ cross)
    return matrices


def rotation_vectors(matrices: FloatArray) -> FloatArray:
    """Return the rotation vectors (..., 3), rad, of matrices (..., 3, 3)."""
    sines = np.empty(matrices.shape[:-1])  # the skew part
    sines[..., 0] = matrices[..., 2, 1] - matrices[..., 1, 2]
    sines[..., 1] = matrices[..., 0, 2] - matrices[..., 2, 0]
    sines[..., 2] = matrices[..., 1, 0] - matrices[..., 0, 1]
    sines *= 0.5
    sine = np.sqrt((sines * sines).sum(axis=-1))
    cosine = 0.5 * (matrices[..., 0, 0] + matrices[..., 1, 1] + matrices[..., 2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    ratio = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)
    vectors: FloatArray = sines * ratio[..., None]
    if (near := cosine < HALF_TURN_COSINE).any():
        for index in np.argwhere(near):
            place = tuple(index)
            vectors[place] = _near_half_turn(matrices[place], sines[place], float(angle[place]))
    return vectors


def _near_half_turn(matrix: FloatArray, sines: FloatArray, angle: float) -> FloatArray:
    """Return the rotation vector from the symmetric part, 2aaᵀ - 1."""
    outer = 0.5 * (matrix + matrix.T) + np.eye(3)
    column = outer[:, int(np.argmax(np.diag(outer)))]
    axis: FloatArray = column / np.linalg.norm(column)
    return angle * (axis if axis @ sines >= 0.0 else -axis)


def pose_differences(poses: FloatArray, target: FloatArray) -> FloatArray:
    """Return the displacements from ``poses`` (..., 4, 4) to ``target``; shape (..., 6).

    Translation in m, then the rotation vector in rad, both in the frame of the poses.
    """
    turned = target[..., :3, :3] @ np.swapaxes(poses[..., :3, :3], -1, -2)
    shift = target[..., :3, 3] - poses[..., :3, 3]
    return np.concatenate([shift, rotation_vectors(turned)], axis=-1)


def moved_pose(pose: FloatArray, displacement: FloatArray) -> FloatArray:
    """Return ``pose`` moved by ``displacement`` (6,) along fixed axes: m, and rotation vector."""
    result = pose.copy()
    result[:3, 3] += displacement[:3]
    if displacement[3:].any():
        result[:3, :3] = rotation_matrices(displacement[3:]) @ pose[:3, :3]
    return result


def turned_twist(rotation: FloatArray, twist: FloatArray) -> FloatArray:
    """Return a twist (6,) in the axes of ``rotation`` (3, 3)."""
    return np.concatenate([rotation @ twist[:3], rotation @ twist[3:]])


def inverse_pose(pose: FloatArray) -> FloatArray:
    """Return the inverse of a pose (4, 4)."""
    result = np.eye(4)
    result[:3, :3] = pose[:3, :3].T
    result[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return result


def pose_of(
    position: Sequence[float] | FloatArray = (0.0, 0.0, 0.0),
    rpy: Sequence[float] | FloatArray = (0.0, 0.0, 0.0),
) -> FloatArray:
    """Return a pose (4, 4) of m and of roll, pitch, yaw in rad."""
    return frame(np.asarray(position, np.float64), np.asarray(rpy, np.float64))


def rpy_of(matrix: FloatArray) -> FloatArray:
    """Return roll, pitch, yaw about fixed axes, rad, of a rotation or pose.

    Pitch is within a quarter turn. At a pitch of a quarter turn, roll is 0.
    """
    horizontal = np.hypot(matrix[0, 0], matrix[1, 0])
    pitch = np.arctan2(-matrix[2, 0], horizontal)
    if horizontal < 1e-9:  # roll and yaw turn about the same axis
        return np.array([0.0, pitch, np.arctan2(-matrix[0, 1], matrix[1, 1])])
    roll = np.arctan2(matrix[2, 1], matrix[2, 2])
    return np.array([roll, pitch, np.arctan2(matrix[1, 0], matrix[0, 0])])


def quaternion_pose(position: Sequence[float], quaternion: Sequence[float]) -> FloatArray:
    """Return a pose (4, 4) of m and a quaternion x, y, z, w.

    Raises InvalidArgument: a number is not finite, or the quaternion is not of length 1 ± 0.001.
    """
    vector, numbers = np.array(position, np.float64), np.array(quaternion, np.float64)
    if not (np.isfinite(vector).all() and np.isfinite(numbers).all()):
        raise InvalidArgument(f"pose {[*position, *quaternion]} has a number that is not finite")
    length = float(np.linalg.norm(numbers))
    if abs(length - 1.0) > 1e-3:
        raise InvalidArgument(f"quaternion {list(quaternion)} has length {length:.4g}, must be 1")
    x, y, z, w = numbers / length
    result = np.eye(4)
    cross = skew(np.array([x, y, z]))
    result[:3, :3] = np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
    result[:3, 3] = vector
    return result


def checked_pose(pose: FloatArray, name: str = "pose") -> FloatArray:
    """Return ``pose`` as an array; raises InvalidArgument: it is not a pose, named ``name``."""
    matrix = np.asarray(pose, np.float64)
    if matrix.shape != (4, 4):
        raise InvalidArgument(f"{name} has shape {matrix.shape}, must be (4, 4)")
    if not np.isfinite(matrix).all():
        raise InvalidArgument(f"{name} has a number that is not finite")
    rotation = matrix[:3, :3]
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if off > ROTATION_TOLERANCE or np.linalg.det(rotation) < 0.0:
        raise InvalidArgument(f"{name} has no rotation matrix: R·Rᵀ differs from 1 by {off:.2g}")
    return matrix


def checked_components(components: dict[str, float]) -> dict[str, float]:
    """Return components of a pose by name. Raises InvalidArgument."""
    for name, value in components.items():
        if name not in COMPONENTS:
            hint = did_you_mean(name, COMPONENTS)
            raise InvalidArgument(f"{name!r} is none of {', '.join(COMPONENTS)}{hint}")
        if not np.isfinite(value):
            raise InvalidArgument(f"{name} is {value}, must be a finite number")
    return components


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
