"""Dead reckoning: the pose of a base from the positions of its wheels."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robotd.motion.base_kinematics import BaseKinematics
from robotd.motion.planar import ORIGIN, Pose, along_arc


class Odometry:
    """Pose since the last ``reset``, from the positions of the wheels.

    Between two updates each wheel is taken to turn evenly, so the base runs along an arc, which
    is integrated exactly. The first update after the start, or after ``rebase``, only takes the
    wheels' positions as the baseline. Not thread-safe.

    ``wrap``: range in rad after which a wheel's position begins again; None: it never does.
    """

    def __init__(self, wheels: BaseKinematics, wrap: float | None = None) -> None:
        self.pose = ORIGIN
        self._wheels = wheels
        self._wrap = wrap
        self._last: Sequence[float] | None = None

    def update(self, positions: Sequence[float], longest_step: float = math.inf) -> bool:
        """Move on to the wheels' positions in rad, which are finite.

        False, and a new baseline, when a wheel is further from its last position than
        ``longest_step`` rad: its encoder was reset, or it was homed; it has not turned.
        """
        last, self._last = self._last, positions
        if last is None:
            return True
        steps = [self._step(now - before) for now, before in zip(positions, last, strict=True)]
        for place in self._wheels.steered:  # the mean angle between two updates
            steps[place] = 0.0
        if max(map(abs, steps)) > longest_step:
            return False
        for place in self._wheels.steered:
            steps[place] = (last[place] + positions[place]) / 2
        self.pose = along_arc(self.pose, self._wheels.twist(*steps))
        return True

    def rebase(self) -> None:
        """Take the next positions as the baseline, wherever they are; the pose stays."""
        self._last = None

    def reset(self, pose: Pose = ORIGIN) -> None:
        """Make ``pose`` the present one."""
        self.pose = pose

    def _step(self, change: float) -> float:
        return change if self._wrap is None else math.remainder(change, self._wrap)
