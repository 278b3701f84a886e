"""A gripper as one value of actions and observations."""

from __future__ import annotations

from robotd.clock import Clock
from robotd.descriptor import GripperSettings
from robotd.device.gripper import Gripper


class GripperValue:
    """Position of a finger in m; commands go to the nearer end. One thread.

    Args:
        gripper: of the robot; nothing else in the process asks for its position.
        settings: its ends.
        clock: of the robot.
    """

    def __init__(self, gripper: Gripper, settings: GripperSettings, clock: Clock) -> None:
        self._gripper, self._clock = gripper, clock
        self._open_m, self._closed_m = settings.open_m, settings.closed_m
        self._commanded: bool | None = None

    @property
    def position_m(self) -> float:
        """Position that follows from the output and the time of travel."""
        closed = self._gripper.closed(self._clock.now_ns())
        return self._open_m + (self._closed_m - self._open_m) * closed

    def move(self, position_m: float) -> float:
        """Open or close, whichever end is nearer; return that end.

        The output is set when the end changes, so that other clients of the gripper are not
        overruled in every period.
        """
        closes = abs(position_m - self._closed_m) < abs(position_m - self._open_m)
        if closes is not self._commanded:
            self._gripper.command(closes)
            self._commanded = closes
        return self._closed_m if closes else self._open_m
