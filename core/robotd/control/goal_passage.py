"""Passage of a last point with a velocity."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion import Tolerances, Trajectory, Violation


class GoalPassage:
    """Finds out when every joint has passed the last point of its goal. Control-loop thread.

    A joint passes it when its measured position is within the goal tolerance of the point, or
    crosses it between two periods, at the time of the point or later: joints that follow with
    different lags pass one after the other.

    Args:
        trajectory: with ``goal_s``.
        tolerances: of the goal.
    """

    def __init__(self, trajectory: Trajectory, goal_s: float, tolerances: Tolerances) -> None:
        self._goal_s, self._tolerances = goal_s, tolerances
        self._point = trajectory.state_at(goal_s).position
        self._closest: FloatArray = np.full_like(self._point, np.inf)
        self._before: FloatArray = np.full_like(self._point, np.nan)

    def update(self, time_s: float, measured: FloatArray) -> bool:
        """Take positions (m,) measured at trajectory time ``time_s``; True: all have passed."""
        error = measured - self._point
        if time_s >= self._goal_s:
            distance = np.where(error * self._before <= 0.0, 0.0, np.abs(error))
            np.fmin(self._closest, distance, self._closest)
        self._before = error
        return time_s >= self._goal_s and self.violation() is None

    def violation(self) -> Violation | None:
        """Return the joint that came least close to the point; None when all have passed."""
        rest = np.zeros_like(self._point)
        return self._tolerances.check_goal(self._goal_s, self._closest, rest, rest)
