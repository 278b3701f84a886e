"""Longer trajectory for an execution under way."""

from __future__ import annotations

from dataclasses import dataclass

from robotd.motion import RateBounds, Trajectory


@dataclass(eq=False)
class Extension:
    """Trajectory that takes the place of the one that is executed, which it begins with.

    Attributes:
        same_s: trajectory time up to which both are the same.
        rate_bounds: see ``PlannedGoal``.
        accepted: set by the control loop; False: the path was past ``same_s``, or is stopped.
    """

    trajectory: Trajectory
    same_s: float
    rate_bounds: RateBounds | None = None
    accepted: bool | None = None
