"""Plausibility check of received positions against the velocity limit of the axis."""

from __future__ import annotations

from collections.abc import Callable

from robotd_cia402.scaling import Scaling, wrapped


class PositionPlausibility:
    """Rejects positions of one axis that it cannot have reached. Receive thread.

    The measured position becomes the command when the servo goes on or off: a corrupt one would be
    sent to the motor. A jump is accepted when the next position is near it: then the drive has set
    its position.

    Args:
        scaling: of the axis; its ``velocity_limit`` bounds the distance.
        horizon_s: longest time between two accepted positions.
        may_jump: True for a new drive, or one that is homing.
    """

    def __init__(self, scaling: Scaling, horizon_s: float, may_jump: Callable[[], bool]) -> None:
        self._scaling, self._horizon_s, self._may_leap = scaling, horizon_s, may_jump
        self._last = self._suspect = 0

    def check(self, count: int) -> None:
        """Raise ValueError for an implausible position ``count``."""
        scaling = self._scaling
        reach = scaling.counts_per_unit * scaling.velocity_limit * self._horizon_s
        step = wrapped(count - self._last)
        is_far = abs(step) > reach and abs(wrapped(count - self._suspect)) > reach
        if is_far and not self._may_leap():
            self._suspect = count
            raise ValueError(f"the position jumps by {step * scaling.position:.3g} rad (or m)")
        self._last = self._suspect = count
