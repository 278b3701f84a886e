"""A position that an axis cannot have reached since it last said where it is."""

from __future__ import annotations

from collections.abc import Callable

from robotd_canopen.scaling import Scaling, wrapped


class PositionPlausibility:
    """Keeps one axis' positions that cannot be out; the receive thread.

    What is measured becomes the command when the servo goes on or off: believed garbage would be
    sent to the motor. A leap is believed when the next position is near it, for then the drive has
    counted anew.

    Args:
        scaling: of the axis; its ``velocity_limit`` says how far it can go.
        horizon_s: longest time between two positions that are both believed.
        may_jump: the drive is new, or sets its position at this moment.
    """

    def __init__(self, scaling: Scaling, horizon_s: float, may_jump: Callable[[], bool]) -> None:
        self._scaling, self._horizon_s, self._may_leap = scaling, horizon_s, may_jump
        self._last = self._suspect = 0

    def check(self, count: int) -> None:
        """Raise ValueError when ``count`` is not to be believed."""
        scaling = self._scaling
        reach = scaling.counts_per_unit * scaling.velocity_limit * self._horizon_s
        step = wrapped(count - self._last)
        is_far = abs(step) > reach and abs(wrapped(count - self._suspect)) > reach
        if is_far and not self._may_leap():
            self._suspect = count
            raise ValueError(f"the position leaps by {step * scaling.position:.3g} rad (or m)")
        self._last = self._suspect = count
