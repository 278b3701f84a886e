"""Positions of a drive that it cannot have reached."""

from __future__ import annotations

from robotd_cia402.scaling import Scaling, wrapped


class PositionPlausibility:
    """Rejects positions of one axis that it cannot have reached. Receive thread.

    The measured position becomes the command when the servo goes on or off: a corrupt one would be
    sent to the motor. So a position counts if it is near the one before, or near the rejected one
    before: then the drive has set its position. A new drive's first position is confirmed likewise.

    Args:
        scaling: of the axis; its ``velocity_limit`` bounds the distance.
        horizon_s: longest time between two accepted positions.
    """

    def __init__(self, scaling: Scaling, horizon_s: float) -> None:
        self._scaling, self._horizon_s = scaling, horizon_s
        self._last: int | None = None
        self._suspect: int | None = None

    def check(self, count: int, *, may_jump: bool) -> bool:
        """Return True for a position that counts; False: one near it has to come first.

        Raises ValueError for an implausible position, unless it ``may_jump``: of a new drive, or
        one that is homing.
        """
        if not (self._is_near(count, self._last) or self._is_near(count, self._suspect)):
            self._suspect = count
            if may_jump:
                return False
            step = wrapped(count - (self._last or 0)) * self._scaling.position
            raise ValueError(f"the position jumps by {step:.3g} rad (or m)")
        self._last = self._suspect = count
        return True

    def forget(self) -> None:
        """Forget the positions: those of a drive that is configured again may be others."""
        self._last = self._suspect = None

    def _is_near(self, count: int, before: int | None) -> bool:
        if before is None:
            return False
        scaling = self._scaling
        reach = scaling.counts_per_unit * scaling.velocity_limit * self._horizon_s
        return abs(wrapped(count - before)) <= reach
