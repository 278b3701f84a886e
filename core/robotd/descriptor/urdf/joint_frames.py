"""Transforms of the joints of a URDF as translations and quaternions, all joints at once.

Each one is the frame of the child link in that of the parent, as ``/tf`` has it: no chain is
multiplied, so the cost per joint is constant.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotd.arrays import FloatArray
from robotd.descriptor.urdf.urdf_model import UrdfJoint, UrdfRobot


class JointFrames:
    """Transforms of the joints that follow known positions. Immutable; any thread.

    Args:
        urdf: the robot.
        names: joints whose positions are known, in the order of ``transforms``.

    Attributes:
        moving: joints that follow ``names``, themselves or as their mimics.
        still: all others: fixed, or moved by nothing that is known here; these are at 0.
    """

    def __init__(self, urdf: UrdfRobot, names: Sequence[str]) -> None:
        known = {name: column for column, name in enumerate(names)}
        shares = {joint.name: _share(urdf, joint, known) for joint in urdf.joints}
        self.moving = tuple(joint for joint in urdf.joints if shares[joint.name] is not None)
        self.still = tuple(joint for joint in urdf.joints if shares[joint.name] is None)
        self._urdf = urdf
        count = len(self.moving)
        self._ratios: FloatArray = np.zeros((count, len(names)))
        self._offsets: FloatArray = np.zeros(count)
        self._start: FloatArray = np.zeros((count, 7))  # at position 0
        self._slide: FloatArray = np.zeros((count, 3))  # translation per m
        self._half_turn: FloatArray = np.zeros(count)  # half angle per rad
        self._across: FloatArray = np.zeros((count, 4))  # quaternion turned by π about the axis
        for row, joint in enumerate(self.moving):
            column, ratio, offset = shares[joint.name] or (0, 0.0, 0.0)
            self._ratios[row, column], self._offsets[row] = ratio, offset
            self._start[row] = transform_numbers(joint.origin)
            if joint.type == "prismatic":
                self._slide[row] = joint.origin[:3, :3] @ joint.axis
            else:
                self._half_turn[row] = 0.5
                self._across[row] = _product(self._start[row, 3:], np.append(joint.axis, 0.0))

    def transforms(self, positions: FloatArray) -> FloatArray:
        """Return the transforms of the ``moving`` joints; shape (n, 7).

        Each row is x, y, z and the quaternion x, y, z, w.

        Args:
            positions: of the known joints, rad or m; shape (names,).
        """
        place = self._ratios @ positions + self._offsets
        half = (self._half_turn * place)[:, np.newaxis]
        result = np.empty_like(self._start)
        result[:, :3] = self._start[:, :3] + self._slide * place[:, np.newaxis]
        result[:, 3:] = np.cos(half) * self._start[:, 3:] + np.sin(half) * self._across
        return result

    def still_transforms(self) -> FloatArray:
        """Return the transforms of the ``still`` joints; shape (n, 7), as ``transforms``."""
        rows = [
            transform_numbers(joint.transform(self._urdf.position(joint, {})))
            for joint in self.still
        ]
        return np.array(rows).reshape(-1, 7)


def transform_numbers(frame: FloatArray) -> FloatArray:
    """Return a frame as numbers; shape (7,).

    x, y, z and the quaternion x, y, z, w with w ≥ 0 of a matrix (4, 4).
    """
    return np.concatenate([frame[:3, 3], _quaternion(frame[:3, :3])])


def _share(
    urdf: UrdfRobot, joint: UrdfJoint, known: dict[str, int]
) -> tuple[int, float, float] | None:
    """Return column, ratio and offset of a joint's position; None: it follows none."""
    leader, ratio, offset = urdf.leader(joint, known)
    if not joint.moves or leader.name not in known:
        return None
    return known[leader.name], ratio, offset


def _quaternion(rotation: FloatArray) -> FloatArray:
    """Return x, y, z, w of a rotation matrix (3, 3), w ≥ 0.

    The eigenvector of the largest eigenvalue (Bar-Itzhack, J. Guidance 23(6), 2000): no case has
    a small divisor.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    symmetric = np.array([
        [xx - yy - zz, xy + yx, xz + zx, zy - yz],
        [xy + yx, yy - xx - zz, yz + zy, xz - zx],
        [xz + zx, yz + zy, zz - xx - yy, yx - xy],
        [zy - yz, xz - zx, yx - xy, xx + yy + zz],
    ])  # fmt: skip
    vector: FloatArray = np.linalg.eigh(symmetric)[1][:, -1]
    return -vector if vector[3] < 0.0 else vector


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the product of two quaternions x, y, z, w."""
    vector = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.append(vector, a[3] * b[3] - a[:3] @ b[:3])
