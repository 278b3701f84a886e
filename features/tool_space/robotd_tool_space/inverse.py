"""Inverse kinematics by damped least squares, of many starts at once.

Levenberg-Marquardt with the damping of Sugihara ("Solvability-Unconcerned Inverse Kinematics by the
Levenberg-Marquardt Method", IEEE Trans. Robotics 27(5), 2011): half the squared error. It shrinks
with the error, so that the last steps are Newton's, and it never divides by a singular matrix.
Joints at a limit that the step would take beyond it are left out of the step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotd.api import BoolArray, FloatArray
from robotd_tool_space.chain import Chain
from robotd_tool_space.rotations import pose_differences
from robotd_tool_space.task import Task

POSITION_TOLERANCE_M = 1e-6
ROTATION_TOLERANCE_RAD = 1e-6
BIAS = 1e-9  # of the damping; without it a singular position at the target has no step
MAX_STEP = 0.7  # rad, or shares of ``length_m``, of one joint in one iteration
CONVERGED = 1e-14  # squared error before the last step
STALLED = 1e-9  # a step below it will not improve any more


@dataclass(frozen=True, eq=False)
class Problem:
    """A pose that is sought: chain, task, target and limits.

    Attributes:
        target: (4, 4) pose of the tool in the base of the chain.
        lower, upper: (n,) position limits.
        length_m: length whose error weighs as much as one radian.
    """

    chain: Chain
    task: Task
    target: FloatArray
    lower: FloatArray
    upper: FloatArray
    length_m: float

    def residual(self, positions: FloatArray) -> FloatArray:
        """Return errors in m and rad that count, (..., 6), of positions (..., n)."""
        pose = self.chain.forward(positions)
        errors = self.task.errors(pose_differences(pose, self.target), pose, self.target)
        if self.task.about_axis:
            linear, turn = errors[..., :-3] @ self.task.chosen, errors[..., -3:]
            linear[..., 3:] = turn
            return linear
        whole: FloatArray = errors @ self.task.chosen
        return whole

    def converged(self, positions: FloatArray) -> BoolArray:
        """Return True, shape (...), for the positions (..., n) that reach the target."""
        error = self.residual(positions)
        near = np.abs(error[..., :3]).max(axis=-1) < POSITION_TOLERANCE_M
        aligned = np.abs(error[..., 3:]).max(axis=-1) < ROTATION_TOLERANCE_RAD
        return np.asarray(near & aligned)

    def solve(self, starts: FloatArray, iterations: int = 60, *, until: str = "all") -> FloatArray:
        """Return where the iteration leads to from ``starts`` (s, n), within the limits.

        Args:
            starts: positions, rad or m.
            iterations: at most.
            until: the others are given up when the "first" start has ended, or when "any" has
                converged.
        """
        result = np.clip(starts, self.lower, self.upper)
        active = np.arange(len(result))
        for _ in range(iterations):
            step, error = self._step(result[active])
            result[active] = np.clip(result[active] + step, self.lower, self.upper)
            converged = error < CONVERGED
            active = active[~converged & (np.abs(step).max(axis=-1) > STALLED)]
            if not len(active) or (until == "first" and active[0] != 0):
                break
            if until == "any" and converged.any():
                break
        return result

    def _step(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the step (s, n) and the squared error (s,) before it."""
        pose, jacobian = self.chain.forward_and_jacobian(positions)
        weights = pose_weights(self.length_m)
        difference = pose_differences(pose, self.target) * weights
        errors = self.task.errors(difference, pose, self.target)
        rows = self.task.rows(jacobian * weights[:, None], pose)
        squared = (errors * errors).sum(axis=-1)
        # In lengths, so that a sliding joint is damped as a turning one.
        scale = np.where(self.slides, self.length_m, 1.0)
        rows = rows * scale
        step = _damped(rows, errors, squared)
        outward = (positions + step * scale < self.lower) | (positions + step * scale > self.upper)
        at_limit = (positions <= self.lower) | (positions >= self.upper)
        if (held := outward & at_limit).any():
            rows = np.where(held[:, None, :], 0.0, rows)
            step = np.where(held, 0.0, _damped(rows, errors, squared))
        largest = np.abs(step).max(axis=-1, keepdims=True)
        shortened: FloatArray = (
            step * scale * np.minimum(1.0, MAX_STEP / np.maximum(largest, 1e-12))
        )
        return shortened, squared

    @property
    def slides(self) -> BoolArray:
        """(n,) True for the joints that are prismatic."""
        moved = self.chain.ratios != 0.0
        return np.asarray((moved & self.chain.slides[:, None]).any(axis=0))


def pose_weights(length_m: float) -> FloatArray:
    """Return the weights (6,) of a pose's difference: 1/length, and 1 of the rotation."""
    return np.array([1.0 / length_m] * 3 + [1.0] * 3)


def _damped(rows: FloatArray, errors: FloatArray, squared: FloatArray) -> FloatArray:
    transposed = np.swapaxes(rows, -1, -2)
    normal = transposed @ rows
    damping = (0.5 * squared + BIAS)[..., None, None] * np.eye(rows.shape[-1])
    solved = np.linalg.solve(normal + damping, transposed @ errors[..., None])
    return np.asarray(solved[..., 0], np.float64)
