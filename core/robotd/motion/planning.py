"""Planning: check a request whole and turn it into a trajectory, or reject it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.extremes import PathPeaks
from robotd.motion.joints import JointLimits, MotionState, TrajectoryRules
from robotd.motion.path import PathBuilder
from robotd.motion.path_checks import (
    acceleration_notes,
    check_end,
    check_path_limits,
    merge_close,
    merge_note,
)
from robotd.motion.path_ends import with_run_out
from robotd.motion.rejection import reject
from robotd.motion.request import TrajectoryRequest, arrange
from robotd.motion.trajectory import Trajectory


def plan(
    request: TrajectoryRequest,
    limits: JointLimits,
    rules: TrajectoryRules,
    start: MotionState,
    recent_path: FloatArray | None = None,
) -> Trajectory:
    """Check ``request`` and plan it from ``start``, in the axis order of ``limits``.

    ``start`` is the commanded state at the moment the trajectory begins. It may be moving:
    position and velocity go on without a step. The acceleration does so too where the request
    gives accelerations and its first point comes after time 0. A single point that is
    elsewhere is a plain move within its time. Joints that the request lacks hold their
    position. A last point with a velocity, where the rules allow it, is passed, and a run-out
    to rest follows.

    A pure function, for a worker thread: 35 ms for 3000 points of 6 joints, during most of
    which NumPy lets other threads run.

    ``recent_path``: (w, m) positions that the joints had or will have, at any of which a first
    point at time 0 may be; None: at ``start`` only.
    Raises TrajectoryRejected: naming joint, time, value and limit.
    """
    _check_start(start, limits)
    points = arrange(request, limits, rules, start)
    merged = merge_close(points, limits)
    check_end(merged, limits, may_move=rules.allow_end_velocity)
    trajectory = PathBuilder(merged, start, limits, rules, recent_path).build()
    trajectory = with_run_out(trajectory, limits)
    peaks = PathPeaks.of(trajectory.breaks, trajectory.coefficients)
    check_path_limits(peaks, limits, rules, start)
    notes = (*points.notes, *merge_note(points, merged), *acceleration_notes(peaks, limits))
    return replace(trajectory, notes=notes)


def _check_start(start: MotionState, limits: JointLimits) -> None:
    if start.position.shape != (len(limits.names),):
        raise ValueError(f"start state of {start.position.shape} for {len(limits.names)} joints")
    for quantity in ("position", "velocity", "acceleration"):
        known = np.isfinite(getattr(start, quantity))
        if not known.all():
            joint = int(np.argmin(known))
            raise reject(f"{limits.names[joint]}: the present {quantity} is not known")
