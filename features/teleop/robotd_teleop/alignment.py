"""Slow approach of a robot to its leader, before it follows it directly."""

from __future__ import annotations

import numpy as np

from robotd.api import FloatArray

TOLERANCE_RAD = 0.02
RAMP_S = 0.5  # to the speed of the approach
JUMP_RAD = 0.3  # between two samples of a leader: no hand is so fast


class Alignment:
    """Targets that begin where the robot is and reach the leader at a low speed.

    Args:
        speed: of the approach, rad/s or m/s.

    Attributes:
        aligned: the robot follows directly.
    """

    def __init__(self, speed: float) -> None:
        self.aligned = False
        self._speed, self._pace = speed, 0.0
        self._target: FloatArray | None = None

    def restart(self) -> None:
        """Begin anew from where the robot is: the leader was lost, or the robot stopped."""
        self.aligned, self._target, self._pace = False, None, 0.0

    def step(self, wanted: FloatArray, present: FloatArray, elapsed_s: float) -> FloatArray:
        """Return the next target.

        Args:
            wanted: (n,) pose of the leader, within the robot's limits.
            present: (n,) commanded positions of the robot; used where an approach begins.
            elapsed_s: since the step before.
        """
        if self._target is None:
            self._target = present.copy()
        if self.aligned and np.abs(wanted - self._target).max() > JUMP_RAD:
            self.aligned, self._pace = False, 0.0
        if self.aligned:
            self._target = wanted.copy()
        else:
            self._pace = min(self._speed, self._pace + self._speed * elapsed_s / RAMP_S)
            step = self._pace * elapsed_s
            self._target = self._target + np.clip(wanted - self._target, -step, step)
            self.aligned = bool(np.abs(wanted - self._target).max() <= TOLERANCE_RAD)
        return self._target
