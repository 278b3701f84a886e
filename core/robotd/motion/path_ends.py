"""Ends of a path: blend-in of a start deviation, run-out after a moving end.

Blend: a path that starts elsewhere is reached within the limits.
The path P of the client is kept, and a deviation δ(t) that fades to zero is added to it:
δ(0) = start - P(0) in position and velocity, δ''(0) = 0, and δ = δ' = δ'' = 0 at the end T. So
position and velocity begin where the joints are, and the acceleration at time 0 is the
client's. δ is one quintic for each joint; T is a knot of P.

Run-out: motion to rest after a last point that has a velocity.
All joints brake together, in the direction of the end velocity v: q(t) = q_e + v·T·(u - u³ + u⁴/2)
with u = t/T, whose velocity is v·(1 - 3u² + 2u³). Its acceleration begins and ends with zero and is
at most 1.5·|v|/T, which gives the shortest T that the joints' acceleration limits allow, at least
``SHORTEST_S``; the stopping distance is v·T/2.
"""

from __future__ import annotations

from dataclasses import replace
from math import comb

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.interpolation import quintic
from robotd.motion.joints import JointLimits, MotionState
from robotd.motion.rejection import distinct, reject
from robotd.motion.request import REST_VELOCITY
from robotd.motion.trajectory import Trajectory

# Shares of a joint's limits that a blend may add where the client's path uses them up.
ACCELERATION_SHARE = 0.2
VELOCITY_SHARE = 0.1
# δ' swings to this part of the velocity deviation that it takes away, whatever T is.
_SWING = 0.513

_SAMPLES = 33  # at which the limits are compared while T is looked for
_GROWTH = 1.25  # of T from one try to the next


def blend_in(
    path: Trajectory, start: MotionState, limits: JointLimits, velocity_margin: float
) -> tuple[FloatArray, float]:
    """Return coefficients of ``path`` starting at ``start``, and time T in s.

    T is the first knot for which no joint exceeds its limits: the acceleration stays within
    the limit or adds a fifth of it to the client's, and the velocity stays between the start's
    and the client's, give or take a tenth of the limit and the swing of δ'. Where no knot is
    late enough it is the last one. Coefficients have the shape (k, order, m).
    """
    begin = path.state_at(0.0)
    offset = np.array([start.position - begin.position, start.velocity - begin.velocity])
    if not offset.any():
        return path.coefficients, 0.0
    end_s = 0.0
    for knot_s in path.breaks[1:].tolist():
        if knot_s < _GROWTH * end_s:
            continue
        end_s = knot_s
        if _is_within(path, _deviation(offset, end_s), end_s, start, limits, velocity_margin):
            break
    else:
        end_s = path.duration_s
    return _add(path, _deviation(offset, end_s), end_s), end_s


def _deviation(offset: FloatArray, end_s: float) -> FloatArray:
    """Return δ as coefficients (6, m)."""
    zero = np.zeros((2, offset.shape[1]))
    position, velocity = zero.copy(), zero.copy()
    position[0], velocity[0] = offset
    deviation: FloatArray = quintic(np.array([0.0, end_s]), position, velocity, zero)[0]
    return deviation


def _is_within(
    path: Trajectory,
    deviation: FloatArray,
    end_s: float,
    start: MotionState,
    limits: JointLimits,
    velocity_margin: float,
) -> bool:
    times_s = np.linspace(0.0, end_s, _SAMPLES)
    _, velocity, acceleration = path.evaluate(times_s)
    powers = times_s[:, None] ** np.arange(5, -1, -1.0)
    slopes = np.arange(5, 0, -1.0)
    first = deviation[:-1] * slopes[:, None]
    second = first[:-1] * slopes[1:, None]
    total_velocity = velocity + powers[:, 1:] @ first
    total_acceleration = np.abs(acceleration + powers[:, 2:] @ second)
    allowed = np.maximum(
        limits.acceleration,
        np.abs(acceleration) + ACCELERATION_SHARE * limits.acceleration,
    )
    room = VELOCITY_SHARE * limits.velocity + _SWING * np.abs(start.velocity - velocity[0])
    lowest = np.minimum(velocity, start.velocity) - room
    highest = np.maximum(velocity, start.velocity) + room
    fastest = np.maximum(
        limits.velocity * (1.0 + velocity_margin),
        np.maximum(np.abs(velocity), np.abs(start.velocity)),
    )
    return bool(
        (total_acceleration <= allowed).all()
        and (total_velocity >= np.maximum(lowest, -fastest)).all()
        and (total_velocity <= np.minimum(highest, fastest)).all()
    )


def _add(path: Trajectory, deviation: FloatArray, end_s: float) -> FloatArray:
    """Return the sum as coefficients (k, 6, m), δ shifted to each segment."""
    segments, order, joints = path.coefficients.shape
    total = np.zeros((segments, 6, joints))
    total[:, 6 - order :] = path.coefficients
    begins = path.breaks[:-1]
    within = begins < end_s
    for power in range(6):  # of the time since the knot
        shifted = sum(
            comb(j, power) * begins[within, None] ** (j - power) * deviation[5 - j]
            for j in range(power, 6)
        )
        total[within, 5 - power] += shifted
    return total


# Also of joints without an acceleration limit. A client that waits for the result of a goal and
# then sends the next takes over 30 ms after it has arrived (``LEAD_S``), in motion.
SHORTEST_S = 0.2
_PEAK = 1.5  # of the acceleration, in |v|/T
_ORDER = 5


def with_run_out(path: Trajectory, limits: JointLimits) -> Trajectory:
    """Return ``path`` with a run-out if it ends with a velocity, else ``path``.

    Raises TrajectoryRejected: a joint would leave its position limits before it rests.
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
