"""Points of the cubic spline that replaces a trajectory on a device that interpolates.

The device joins the points by the cubic spline at rest at both ends. Where the trajectory is
such a spline and short enough, its own knots are the points. Any other path is sampled, and the
intervals in which the spline through the samples leaves the path are halved until it does not.
"""

from __future__ import annotations

import numpy as np

from robotd.arrays import BoolArray, FloatArray
from robotd.motion.interpolation import Interpolation, clamped_spline
from robotd.motion.rejection import reject
from robotd.motion.trajectory import Trajectory

MAX_ERROR = 1e-4  # rad or m, between the device's spline and the trajectory

_STEP_S = 0.01  # first spacing, where it needs no more points than the device takes
_FIRST_SHARE = 0.25  # of the device's points for the first spacing otherwise
_CHECKS = np.array([0.2, 0.4, 0.6, 0.8])  # of an interval, at which spline and path are compared


def spline_points(trajectory: Trajectory, max_points: int) -> tuple[FloatArray, FloatArray]:
    """Return times (k,) in s and positions (k, m), k ≤ ``max_points``.

    The spline through them is within ``MAX_ERROR`` of the trajectory at all times.

    Raises TrajectoryRejected: more than ``max_points`` points are needed.
    """
    if trajectory.kind is Interpolation.CUBIC_SPLINE and len(trajectory.breaks) <= max_points:
        return trajectory.breaks, np.ascontiguousarray(trajectory.knot_positions)
    times_s = _first_times(trajectory.duration_s, max_points)
    while len(times_s) <= max_points:
        positions = trajectory.evaluate(times_s)[0]
        off = _off_path(trajectory, times_s, positions)
        if not off.any():
            return times_s, np.ascontiguousarray(positions)
        middles = (times_s[:-1] + np.diff(times_s) / 2.0)[off]
        times_s = np.sort(np.concatenate([times_s, middles]))
    raise reject(
        f"the device takes {max_points} points, and a spline within {1e3 * MAX_ERROR:g} mrad of "
        f"the path of {len(trajectory.breaks)} points needs {len(times_s)} or more; split the "
        "trajectory"
    )


def _first_times(duration_s: float, max_points: int) -> FloatArray:
    count = int(np.clip(np.ceil(duration_s / _STEP_S), 2, None))
    if count >= max_points:
        count = max(2, int(_FIRST_SHARE * max_points))
    return np.linspace(0.0, duration_s, count + 1)


def _off_path(trajectory: Trajectory, times_s: FloatArray, positions: FloatArray) -> BoolArray:
    """Return True for each interval (k - 1,) that leaves the path."""
    lengths = np.diff(times_s)
    coefficients = clamped_spline(times_s, positions)
    since_knot = lengths[:, None, None] * _CHECKS[:, None]
    spline = np.zeros((len(lengths), len(_CHECKS), positions.shape[1]))
    for power in range(coefficients.shape[1]):
        spline = spline * since_knot + coefficients[:, None, power]
    checked_s = times_s[:-1, None] + lengths[:, None] * _CHECKS
    path = trajectory.evaluate(checked_s.reshape(-1))[0].reshape(spline.shape)
    error = np.abs(spline - path).max(axis=(1, 2))
    off: BoolArray = error > MAX_ERROR
    return off
