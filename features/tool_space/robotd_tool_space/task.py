"""Components of a pose that an arm can choose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotd.api import FloatArray
from robotd_tool_space.chain import Chain

SAMPLES = 40
RANK_TOLERANCE = 1e-6  # relative to the largest singular value
TWIST_NAMES = ("x", "y", "z", "rotation about x", "rotation about y", "rotation about z")


@dataclass(frozen=True, eq=False)
class Task:
    """Components of a pose that an arm can choose, by its structure.

    Attributes:
        chosen: (k, 6) orthonormal rows: directions of motion, in the base, that count.
        impossible: (6 - r, 6) orthonormal rows: directions in which the tool never moves. A
            target has to agree with the pose of the tool there.
        about_axis: True: the direction of the tool's z axis counts, not the rotation about it
            (arms of five axes); its rows are then those of the position.
        free: names of the components of a pose that do not count though the tool moves there.
    """

    chosen: FloatArray
    impossible: FloatArray
    about_axis: bool = False
    free: str = ""

    @classmethod
    def of(cls, chain: Chain, lower: FloatArray, upper: FloatArray) -> Task:
        """Return the task of a chain.

        An arm with as many joints as directions, or more, chooses all directions in which its tool
        ever moves: six, or four of a SCARA, or three of a gantry. One with fewer chooses the
        position, and with five joints the direction of the tool's z axis.
        """
        random = np.random.default_rng(0)
        span = np.clip(lower, -np.pi, np.pi), np.clip(upper, -np.pi, np.pi)
        positions = random.uniform(*span, (SAMPLES, len(chain.names)))
        jacobians = chain.forward_and_jacobian(positions)[1]
        moved, never = _directions(np.swapaxes(jacobians, 1, 2).reshape(-1, 6))
        joints = int(np.linalg.matrix_rank(chain.ratios, tol=RANK_TOLERANCE))
        if len(moved) <= joints:
            return cls(moved, never)
        linear = np.swapaxes(jacobians[:, :3], 1, 2).reshape(-1, 3)
        position = np.hstack([_directions(linear)[0], np.zeros((3, 3))[: _rank(linear)]])
        if joints == 5 and len(position) == 3:
            return cls(
                position, never, about_axis=True, free="the rotation about the tool's z axis"
            )
        return cls(position, never, free="the orientation of the tool")

    @property
    def is_whole(self) -> bool:
        """True for an arm that chooses all six components."""
        return len(self.chosen) == 6

    def errors(self, difference: FloatArray, pose: FloatArray, target: FloatArray) -> FloatArray:
        """Return the components that count of ``difference`` (..., 6); shape (..., k)."""
        errors = difference @ self.chosen.T
        if not self.about_axis:
            return errors
        z, wanted = pose[..., :3, 2], target[..., :3, 2]
        # The shortest rotation of z to where it is wanted, in the two directions across z.
        turn = np.cross(z, wanted)
        sine = np.linalg.norm(turn, axis=-1, keepdims=True)
        angle = np.arctan2(sine, (z * wanted).sum(axis=-1, keepdims=True))
        turn = turn * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)
        return np.concatenate([errors, turn], axis=-1)

    def rows(self, jacobian: FloatArray, pose: FloatArray) -> FloatArray:
        """Return the Jacobian (..., k, n) of ``errors``, of a Jacobian (..., 6, n)."""
        rows = self.chosen @ jacobian
        if not self.about_axis:
            return rows
        z = pose[..., :3, 2]
        across = np.eye(3) - z[..., :, None] * z[..., None, :]
        return np.concatenate([rows, across @ jacobian[..., 3:, :]], axis=-2)

    def contradiction(self, difference: FloatArray) -> str:
        """Return what of ``difference`` (6,) the arm never moves in, with its amount; "": nothing.

        Within 10 µm and 0.01 mrad it agrees.
        """
        if not len(self.impossible):
            return ""
        off = self.impossible.T @ (self.impossible @ difference)
        largest = int(np.argmax(np.abs(off) * np.array([1.0, 1.0, 1.0, 0.3, 0.3, 0.3])))
        if np.linalg.norm(off[:3]) < 1e-5 and np.linalg.norm(off[3:]) < 1e-5:
            return ""
        unit, places = ("m", 4) if largest < 3 else ("rad", 3)
        return f"{TWIST_NAMES[largest]} by {off[largest]:.{places}f} {unit}"


def _rank(rows: FloatArray) -> int:
    return int(np.linalg.matrix_rank(rows, tol=RANK_TOLERANCE * np.linalg.norm(rows, 2)))


def _directions(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return orthonormal bases of the span of ``rows`` and of its complement.

    Where the span is that of unit vectors they are the basis: no component is mixed with another.
    """
    _, sizes, basis = np.linalg.svd(rows, full_matrices=True)
    rank = int((sizes > RANK_TOLERANCE * sizes[0]).sum())
    projection = basis[:rank].T @ basis[:rank]
    units = np.eye(len(projection))
    if np.allclose(projection, np.diag(np.diag(projection)), atol=1e-9):
        kept = np.diag(projection) > 0.5
        return units[kept], units[~kept]
    return basis[:rank], basis[rank:]
