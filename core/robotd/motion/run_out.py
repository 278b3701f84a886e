"""Run-out: way to rest behind a last point that has a velocity.

All joints brake together, in the direction of the end velocity v: q(t) = q_e + v·T·(u - u³ + u⁴/2)
with u = t/T, whose velocity is v·(1 - 3u² + 2u³). Its acceleration begins and ends with zero and is
at most 1.5·|v|/T, which gives the shortest T that the joints' acceleration limits allow, at least
``SHORTEST_S``; the way is v·T/2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.digits import distinct
from robotd.motion.joints import JointLimits
from robotd.motion.rejection import reject
from robotd.motion.request import REST_VELOCITY
from robotd.motion.trajectory import Trajectory

# Also of joints without an acceleration limit. A client that waits for the result of a goal and
# then sends the next takes over 30 ms after it has arrived (``LEAD_S``), in motion.
SHORTEST_S = 0.2
_PEAK = 1.5  # of the acceleration, in |v|/T
_ORDER = 5


def with_run_out(path: Trajectory, limits: JointLimits) -> Trajectory:
    """Return ``path`` with a run-out if it ends with a velocity, else ``path``.

    Raises:
        TrajectoryRejected: a joint would leave its position limits before it rests.
    """
    velocity = _end_velocity(path)
    if (np.abs(velocity) <= REST_VELOCITY).all():
        return path
    seconds = max(_PEAK * float((np.abs(velocity) / limits.acceleration).max()), SHORTEST_S)
    end = path.final_position + velocity * seconds / 2.0
    _check_room(path, velocity, end, limits)
    segments, order, joints = path.coefficients.shape
    wide = max(order, _ORDER)
    coefficients = np.zeros((segments + 1, wide, joints))
    coefficients[:-1, wide - order :] = path.coefficients
    coefficients[-1, -_ORDER:] = [
        velocity / (2.0 * seconds**3),
        -velocity / seconds**2,
        np.zeros(joints),
        velocity,
        path.final_position,
    ]
    return replace(
        path,
        breaks=np.append(path.breaks, path.duration_s + seconds),
        coefficients=coefficients,
        final_position=end,
        goal_s=path.duration_s,
    )


def _end_velocity(path: Trajectory) -> FloatArray:
    """Return the velocity (m,) at the end of the last segment."""
    last = path.coefficients[-1]
    order = len(last)
    powers = np.arange(order - 1, 0, -1.0)
    seconds = float(path.breaks[-1] - path.breaks[-2])
    velocity: FloatArray = (powers * seconds ** (powers - 1.0)) @ last[:-1]
    return velocity


def _check_room(
    path: Trajectory, velocity: FloatArray, end: FloatArray, limits: JointLimits
) -> None:
    """Reject a braking distance beyond a position limit that the last point is within."""
    bound = np.where(velocity > 0.0, limits.upper, limits.lower)
    beyond = np.where(velocity > 0.0, end > bound, end < bound) & (np.abs(velocity) > REST_VELOCITY)
    if not beyond.any():
        return
    joint = int(np.argmax(beyond * np.abs(end - bound)))
    name, unit = limits.names[joint], limits.units[joint]
    position, limit = distinct(float(end[joint]), float(bound[joint]))
    raise reject(
        f"{name} at {path.duration_s:.3f} s: braking from {velocity[joint]:.5g} {unit}/s at the"
        f" last point ends at {position} {unit}, beyond its position limit {limit} {unit}"
    )
