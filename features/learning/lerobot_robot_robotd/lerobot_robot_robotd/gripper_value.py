"""A gripper as one value of actions and observations."""

from __future__ import annotations

from robotd.api.robots import Gripper


class GripperValue:
    """Position of the gripper in m; commands go to the nearer end. One thread."""

    def __init__(self, gripper: Gripper) -> None:
        self._gripper = gripper
        self._commanded: bool | None = None

    @property
    def position_m(self) -> float:
        """Position that follows from the output and the time of travel."""
        return self._gripper.position_m

    def move(self, position_m: float) -> float:
        """Open or close, whichever end is nearer; return that end.

        The output is set when the end changes, so that other clients of the gripper are not
        overruled in every period.
        """
        closes = abs(position_m - self._gripper.closed_m) < abs(position_m - self._gripper.open_m)
        if closes is not self._commanded:
            self._gripper.command(closes)
            self._commanded = closes
        return self._gripper.closed_m if closes else self._gripper.open_m
