"""Conditions for a trajectory to be accepted and to count as finished."""

from __future__ import annotations

from dataclasses import dataclass

from robotd.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class TrajectoryRules:
    """Rules of the trajectories of m joints, as numbers in the joints' units.

    Attributes:
        path_tolerance, goal_tolerance: (m,) of goals that have none of their own; inf: unchecked.
        goal_time_s: time after the end to get within ``goal_tolerance``; inf: without an end.
        start_tolerance: (m,) distance from the present position of a first point at time 0.
        stopped_velocity: (m,) speed below which a joint stands.
        max_points: of one trajectory.
        velocity_margin: part by which a path may exceed the velocity limits.
        acceleration_margin: the same of accelerations; None: by any.
        allow_partial_joints: goals of some of the joints; the others have to stand.
        allow_end_velocity: last points with a velocity.
    """

    path_tolerance: FloatArray
    goal_tolerance: FloatArray
    goal_time_s: float
    start_tolerance: FloatArray
    stopped_velocity: FloatArray
    max_points: int
    velocity_margin: float
    acceleration_margin: float | None
    allow_partial_joints: bool
    allow_end_velocity: bool
