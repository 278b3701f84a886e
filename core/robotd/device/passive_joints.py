"""Measured positions of the fingers of a gripper, which have no axes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from robotd.arrays import FloatArray
from robotd.errors import Unsupported


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


class DrivenFingers(PassiveJoints):
    """Fingers of a gripper that the device moves to any position, by a command of its own.

    The output bit of the gripper commands the two ends, also by other clients; the newest command
    replaces the ones before.
    """

    @abstractmethod
    def move(self, positions: Mapping[str, float], force_n: float) -> None:
        """Accept a command to move to ``positions``, by name, rad or m. Worker threads.

        Args:
            force_n: that the fingers may press a part with, N; 0: the device's own.

        Raises NotReady: the fingers cannot be moved now.
        """

    @abstractmethod
    def stop(self) -> None:
        """Begin to stop the fingers on their way; at rest they go on holding a part.

        Any thread, also the control loop, which repeats it until ``at_rest``; must not block.
        """

    @property
    @abstractmethod
    def at_rest(self) -> bool:
        """True when the newest command has ended, or a part has stopped the fingers on their way.

        False also while that is not known. Any thread; must not block.
        """

    def home(self, timeout_s: float) -> None:
        """Find the ends of the stroke, and return once they are known. Worker threads.

        Optional. The fingers move through the whole stroke. They do so on this call only: never
        because the device is opened, or the fingers are commanded without a home. ``stop``, and a
        command that follows, end it.

        Raises NotReady: the fingers cannot be moved now, or hold a part. OperationError: the ends
        were not found, or it was stopped. DeviceTimeout. Unsupported: they need no home.
        """
        raise Unsupported("homing of the fingers")


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


def driven_fingers(joints: PassiveJoints | None, fingers: Sequence[str]) -> DrivenFingers | None:
    """Return the driver of ``fingers``; None unless the device moves exactly these."""
    if isinstance(joints, DrivenFingers) and set(joints.names) == set(fingers):
        return joints
    return None
