"""Measured positions of joints that are no axes, such as the fingers of a gripper."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

import numpy as np

from robotd.arrays import FloatArray


class PassiveJoints(ABC):
    """Joints without an axis, whose positions the device measures.

    A finger of the gripper that is among them is reported where it is, instead of where its
    output bit leads. Other joints are not reported yet.
    """

    @property
    @abstractmethod
    def names(self) -> Sequence[str]:
        """Names as in the URDF, in the order of ``read``. Read once, at start."""

    @abstractmethod
    def read(self, positions: FloatArray) -> None:
        """Fill ``positions`` (n,), rad or m; NaN: not known. Control-loop thread.

        Called after ``AxisDriver.read`` of the same period. Must not block.
        """


FingerReader = Callable[[FloatArray], None]
"""Fills an array (fingers,) with measured positions. Control-loop thread."""


def finger_reader(joints: PassiveJoints | None, fingers: Sequence[str]) -> FingerReader | None:
    """Return the reader of ``fingers``; None unless all of them are measured."""
    if joints is None:
        return None
    names = [*joints.names]
    if not set(fingers) <= set(names):
        return None
    indices = [names.index(finger) for finger in fingers]
    positions: FloatArray = np.full(len(names), np.nan)

    def read(measured: FloatArray) -> None:
        joints.read(positions)
        measured[:] = positions[indices]

    return read
