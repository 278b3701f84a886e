"""Planning: a request is checked whole, then becomes a trajectory, or is refused."""

from __future__ import annotations

import numpy as np

from robotd.descriptor.model import TrajectorySettings
from robotd.motion.interpolation import interpolate, interpolation_of
from robotd.motion.joints import JointLimits, MotionState
from robotd.motion.knots import attach_start, merge_close
from robotd.motion.path_limits import acceleration_notes, check_path_limits
from robotd.motion.peaks import PathPeaks
from robotd.motion.rejection import RejectionCode, TrajectoryRejected, reject
from robotd.motion.request import Points, TrajectoryRequest, arrange
from robotd.motion.trajectory import Trajectory


def plan(
    request: TrajectoryRequest,
    limits: JointLimits,
    settings: TrajectorySettings,
    start: MotionState,
) -> Trajectory:
    """Check ``request`` and plan it from ``start``, in the axis order of ``limits``.

    ``start`` is the commanded state at the moment the trajectory begins. It may be moving:
    position and velocity go on without a step, and so does acceleration where the request
    gives accelerations. A single point that is elsewhere is a plain move within its time.

    A pure function, for a worker thread: some ms for 1000 points of 6 joints, during which
    NumPy lets other threads run.

    Raises:
        TrajectoryRejected: naming joint, time, value and limit.
    """
    _check_start(start, limits)
    points = arrange(request, limits, settings.max_points)
    merged = merge_close(points, limits)
    knots = attach_start(merged, start, limits, settings.start_tolerance_rad)
    coefficients = interpolate(knots, start)
    peaks = PathPeaks.of(knots.times_s, coefficients)
    check_path_limits(peaks, limits, settings.velocity_margin, start)
    return Trajectory(
        names=limits.names,
        kind=interpolation_of(knots),
        breaks=knots.times_s,
        coefficients=coefficients,
        final_position=knots.positions[-1].copy(),
        peaks=peaks,
        notes=(*_merge_note(points, merged), *acceleration_notes(peaks, limits)),
    )


def check_start_delay(delay_s: float, duration_s: float) -> None:
    """Refuse a trajectory that is over already.

    Args:
        delay_s: start stamp of the goal minus now; 0 for a goal without a stamp.
        duration_s: duration of the trajectory.

    Raises:
        TrajectoryRejected: ``OLD_HEADER_TIMESTAMP``.
    """
    if delay_s + duration_s < 0.0:
        raise TrajectoryRejected(
            RejectionCode.OLD_HEADER_TIMESTAMP,
            f"the trajectory of {duration_s:.3f} s should have begun {-delay_s:.3f} s ago: "
            f"it is over",
        )


def _check_start(start: MotionState, limits: JointLimits) -> None:
    if start.position.shape != (len(limits.names),):
        raise ValueError(f"start state of {start.position.shape} for {len(limits.names)} joints")
    for quantity in ("position", "velocity", "acceleration"):
        known = np.isfinite(getattr(start, quantity))
        if not known.all():
            joint = int(np.argmin(known))
            raise reject(f"{limits.names[joint]}: the present {quantity} is not known")


def _merge_note(points: Points, merged: Points) -> tuple[str, ...]:
    dropped = len(points.times_s) - len(merged.times_s)
    return (f"{dropped} points less than 1 ms after another were merged",) if dropped else ()
