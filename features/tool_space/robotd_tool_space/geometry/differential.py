"""Differential inverse kinematics: joint velocities of a twist, and how singular the arm is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robotd.api import FloatArray
from robotd_tool_space.geometry.kinematics import Kinematics

SINGULAR = 1e-3  # smaller singular values are 0: no velocity of the joints moves the tool so


class Rates(NamedTuple):
    """Result for one position.

    Attributes:
        velocity: (n,) of the joints.
        inverse: (n, 6) takes any twist to the velocities.
        singularity: smallest singular value, see ``Kinematics.singularity``.
        missing: share of the twist that no velocity of the joints gives, 0 to 1.
    """

    velocity: FloatArray
    inverse: FloatArray
    singularity: float
    missing: float


class Differential:
    """Joint velocities of twists. Immutable, any thread.

    Of an arm with more joints than directions they are the smallest. Components of a twist in
    which the tool of the arm never moves, or that are not its task, do not count.
    """

    def __init__(self, kinematics: Kinematics) -> None:
        self._task, self._chain = kinematics.task, kinematics.chain
        self._rows = np.diag(kinematics.weights)
        self._columns, self._rank = kinematics.joint_lengths, kinematics.rank

    def at(self, positions: FloatArray, twist: FloatArray) -> tuple[FloatArray, list[Rates]]:
        """Return poses (p, 4, 4) and rates at positions (p, n) for one twist.

        Args:
            twist: (6,) in the base, m/s and rad/s.
        """
        poses, jacobians = self._chain.forward_and_jacobian(positions)
        return poses, self.of_jacobians(poses, jacobians, twist)

    def of_jacobians(
        self, poses: FloatArray, jacobians: FloatArray, twist: FloatArray
    ) -> list[Rates]:
        """Return rates as ``at``, from the poses (p, 4, 4) and Jacobians (p, 6, n)."""
        into = np.broadcast_to(self._rows, (len(poses), 6, 6))
        if not self._task.is_whole:
            into = self._task.rows(into, poses)
        rows = self._scaled(jacobians, poses)
        left, sizes, right = np.linalg.svd(rows, full_matrices=False)
        return [self._rates(*case, twist) for case in zip(into, left, sizes, right, strict=True)]

    def _scaled(self, jacobians: FloatArray, poses: FloatArray) -> FloatArray:
        scaled = self._rows @ jacobians * self._columns
        return scaled if self._task.is_whole else self._task.rows(scaled, poses)

    def _rates(
        self,
        into: FloatArray,
        left: FloatArray,
        sizes: FloatArray,
        right: FloatArray,
        twist: FloatArray,
    ) -> Rates:
        rank = self._rank
        kept = sizes[:rank] > SINGULAR
        inverse = np.where(kept, 1.0 / np.maximum(sizes[:rank], SINGULAR), 0.0)
        across = left[:, :rank].T @ into  # twists in the directions of the singular values
        matrix: FloatArray = self._columns[:, None] * ((right[:rank].T * inverse) @ across)
        missing = 0.0
        if not kept.all():
            wanted = into @ twist
            lost = wanted - left[:, :rank] @ np.where(kept, across @ twist, 0.0)
            missing = float(np.linalg.norm(lost)) / max(float(np.linalg.norm(wanted)), 1e-12)
        return Rates(matrix @ twist, matrix, float(sizes[rank - 1]), missing)
