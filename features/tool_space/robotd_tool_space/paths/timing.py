"""Time parametrization of a path: as fast as the limits of tool and joints allow, also in blends.

The squared speed x = (ds/dt)² of the parameter s is limited by the joint speeds, and its slope
2·d²s/dt² by the joint accelerations q'·s̈ + q''·x. That is linear in x, so that the fastest motion
is found in two passes: backward for the highest speed from which the rest of the path can be kept,
forward for the highest acceleration that stays below it (reachability analysis: Pham and Pham, "A
New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis", IEEE Trans.
Robotics 34(3), 2018). The accelerations then have steps; a moving average over ``smooth_s`` turns
them into ramps. The parts between two stops are averaged each by itself: an average across a stop
would pass it with some speed.

In corners (blends) and arcs the tool has a centripetal acceleration c·x, with the second derivative
c of its pose by s. It gets up to ``CENTRIPETAL_SHARE`` of the limit, which bounds x; the rest by
Pythagoras bounds d²s/dt². Both bounds are spread as far as the moving average reaches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from robotd.api import FloatArray, IntArray, InvalidArgument
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.paths.joint_route import EvenRoute, Route
from robotd_tool_space.paths.tool_curves import ToolSpeed

SAMPLE_S = 0.002  # of the moving average
CENTRIPETAL_SHARE = 0.8  # of the tool's acceleration, at most
LEAST_CENTRIPETAL_SHARE = 0.05  # that counts
MIN_SPEED = 1e-9
NO_CURVATURE = 1e-9
MAX_DURATION_S = 3600.0


class Curve(Protocol):
    """Joint positions over a parameter, as samples and between them; see ``Route``."""

    @property
    def at_s(self) -> FloatArray: ...

    @property
    def positions(self) -> FloatArray: ...

    @property
    def slopes(self) -> FloatArray: ...

    def exact(self, at_s: FloatArray) -> tuple[FloatArray, FloatArray]: ...


@dataclass(frozen=True, eq=False)
class Timing:
    """Parameter of a path over time.

    Attributes:
        times_s: (k,) equidistant, from 0.
        at_s: (k,) parameter of the path.
        speeds: (k,) derivatives of ``at_s``.
        rests_s: times at which the path is at rest: its start, its stops and its end.
    """

    times_s: FloatArray
    at_s: FloatArray
    speeds: FloatArray
    rests_s: tuple[float, ...]

    def at(self, times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return parameter and speed, (m,) each, at (m,) times."""
        at_s = np.interp(times_s, self.times_s, self.at_s)
        return at_s, np.interp(times_s, self.times_s, self.speeds)


def time_route(
    route: Route | EvenRoute,
    kinematics: Kinematics,
    limits: tuple[FloatArray, FloatArray],
    speed: ToolSpeed,
    smooth_s: float,
) -> Timing:
    """Return the fastest timing of a route that starts and ends at rest.

    Args:
        route: whose parameter is the time at full speed. An ``EvenRoute`` gets one speed between
            two rests, except where it speeds up and slows down.
        kinematics: of the tool.
        limits: (n,) velocities and (n,) accelerations of the joints.
        speed: its accelerations are the limits of the tool.
        smooth_s: duration of the moving average.

    Raises InvalidArgument: it takes more than an hour.
    """
    at_s, count = route.at_s, len(route.at_s)
    rests = np.array([0, *route.rests, count - 1])
    _, jacobian = kinematics.chain.forward_and_jacobian(route.positions)
    twists = (jacobian @ route.slopes[..., None])[..., 0]
    rates = np.linalg.norm(twists.reshape(-1, 2, 3), axis=2)
    tool_curvatures = np.linalg.norm(_curvatures(at_s, twists, rests).reshape(-1, 2, 3), axis=2)
    beside = [np.roll(tool_curvatures, 1, 0), np.roll(tool_curvatures, -1, 0)]
    tool_curvatures = np.maximum.reduce([tool_curvatures, *beside])
    slope = np.hstack([route.slopes, rates])
    curvature = np.hstack([_curvatures(at_s, route.slopes, rests), np.zeros((count, 2))])
    limit = np.tile(np.append(limits[1], speed.accelerations), (count, 1))
    fastest = np.append(limits[0], speed.velocities)
    highest = np.minimum(_highest(slope, curvature, fastest, limit), 1.0)
    highest = np.minimum(
        highest,
        (CENTRIPETAL_SHARE * speed.accelerations / (tool_curvatures + NO_CURVATURE)).min(axis=1),
    )
    if isinstance(route, EvenRoute):
        for first, last in pairwise(rests.tolist()):
            highest[first : last + 1] = highest[first : last + 1].min()
    centripetal = (tool_curvatures * highest[:, None] / speed.accelerations).max(axis=1)
    highest, centripetal = _around(at_s, highest, centripetal, smooth_s)
    limit[:, -2:] *= np.sqrt(1.0 - np.minimum(centripetal, CENTRIPETAL_SHARE) ** 2)[:, None]
    return _fastest(at_s, rests, slope, curvature, highest, limit, smooth_s)


def _around(
    at_s: FloatArray, highest: FloatArray, centripetal: FloatArray, smooth_s: float
) -> tuple[FloatArray, FloatArray]:
    """Spread squared speeds and centripetal shares as far as the moving average reaches."""
    capped, widest = highest.copy(), centripetal.copy()
    reaches = smooth_s * np.sqrt(highest)
    firsts = np.searchsorted(at_s, at_s - reaches)
    lasts = np.searchsorted(at_s, at_s + reaches, "right")
    for index in np.flatnonzero(centripetal > LEAST_CENTRIPETAL_SHARE).tolist():
        around = slice(firsts[index], lasts[index])
        np.minimum(capped[around], highest[index], out=capped[around])
        np.maximum(widest[around], centripetal[index], out=widest[around])
    return capped, widest


def time_curve(
    curve: Curve,
    stops: Sequence[int],
    velocity: FloatArray,
    acceleration: FloatArray,
    caps: FloatArray,
    smooth_s: float,
) -> Timing:
    """Return the fastest timing of a curve of the joints that starts and ends at rest.

    Args:
        curve: equidistant samples nearly; its slopes at a stop are those after it.
        stops: inner samples at which it rests, increasing.
        velocity, acceleration: (n,) limits of the joints.
        caps: (k,) highest speeds of the parameter.
        smooth_s: duration of the moving average.

    Raises InvalidArgument: it takes more than an hour.
    """
    at_s, slope = curve.at_s, curve.slopes
    rests = np.array([0, *stops, len(at_s) - 1])
    curvature = _curvatures(at_s, slope, rests)
    limit = np.tile(acceleration, (len(at_s), 1))
    highest = np.minimum(_highest(slope, curvature, velocity, limit), caps**2)
    return _fastest(
        at_s, rests, slope, curvature, _widened(at_s, highest, smooth_s), limit, smooth_s
    )


def _fastest(
    at_s: FloatArray,
    rests: IntArray,
    slope: FloatArray,
    curvature: FloatArray,
    highest: FloatArray,
    limit: FloatArray,
    smooth_s: float,
) -> Timing:
    """Return the fastest timing below the squared speeds ``highest`` (k,)."""
    highest[rests] = 0.0
    rates = np.sqrt(_passes(at_s, slope, curvature, highest, limit))
    seconds = np.diff(at_s) / np.maximum(0.5 * (rates[1:] + rates[:-1]), MIN_SPEED)
    if (total_s := seconds.sum()) > MAX_DURATION_S:  # before the memory for it is asked for
        raise InvalidArgument(f"the motion takes {total_s:.0f} s, at most {MAX_DURATION_S:g} s")
    parts = [slice(first, last + 1) for first, last in pairwise(rests.tolist())]
    return _joined([_smoothed(at_s[part], rates[part], smooth_s) for part in parts])


def _widened(at_s: FloatArray, highest: FloatArray, smooth_s: float) -> FloatArray:
    """Return squared speeds whose minima hold as far around them as the moving average reaches."""
    inner = (highest[1:-1] <= highest[:-2]) & (highest[1:-1] <= highest[2:])
    result = highest.copy()
    for index in (np.flatnonzero(inner) + 1).tolist():
        reach = smooth_s * np.sqrt(highest[index])
        first, last = np.searchsorted(at_s, [at_s[index] - reach, at_s[index] + reach])
        np.minimum(result[first:last], highest[index], out=result[first:last])
    return result


def _curvatures(at_s: FloatArray, slopes: FloatArray, rests: IntArray) -> FloatArray:
    """Return the second derivatives (k, n) of the positions by the parameter.

    The slope at a stop is that after it: it does not count for the part before.
    """
    bends = np.empty_like(slopes)
    edges = rests.copy()
    edges[-1] += 1
    for first, last in pairwise(edges.tolist()):
        bends[first:last] = np.gradient(slopes[first:last], at_s[first:last], axis=0)
    return bends


def _highest(
    slope: FloatArray, curvature: FloatArray, speeds: FloatArray, limit: FloatArray
) -> FloatArray:
    """Return the highest squared speed (k,) at each sample by itself."""
    with np.errstate(divide="ignore", invalid="ignore"):
        highest = ((speeds / np.abs(slope)) ** 2).min(axis=1)
        half, turn = limit / np.abs(slope), -curvature / slope
        turn = np.where(np.isfinite(turn), turn, 0.0)
        # Where a joint tool_curvatures round, only x is left of its acceleration.
        resting = np.abs(slope) < 1e-9
        lone = np.where(resting, limit / np.abs(curvature), np.inf).min(axis=1)
        difference = turn[:, :, None] - turn[:, None, :]
        pairs = np.where(
            difference > 1e-12, (half[:, :, None] + half[:, None, :]) / difference, np.inf
        )
    lowest: FloatArray = np.minimum(np.minimum(highest, lone), pairs.min(axis=(1, 2)))
    return lowest


def _passes(
    at_s: FloatArray,
    slope: FloatArray,
    curvature: FloatArray,
    highest: FloatArray,
    limit: FloatArray,
) -> FloatArray:
    """Return the squared speeds (k,) of the fastest motion."""
    slope = np.where(np.abs(slope) < 1e-9, 1e-9, slope)
    half, turn = limit / np.abs(slope), -curvature / slope
    double = 2.0 * np.diff(at_s)
    squared = highest.copy()
    for index in range(len(at_s) - 2, -1, -1):
        divisor = 1.0 + double[index] * turn[index]
        reach = squared[index + 1] + double[index] * half[index]
        bounded = divisor > 1e-9
        if bounded.any():
            most = (reach[bounded] / divisor[bounded]).min()
            squared[index] = min(squared[index], most)
    for index in range(len(at_s) - 1):
        fastest = (half[index] + turn[index] * squared[index]).min()
        reached = squared[index] + double[index] * max(fastest, 0.0)
        squared[index + 1] = min(squared[index + 1], reached)
    return squared


def _smoothed(at_s: FloatArray, speed: FloatArray, smooth_s: float) -> Timing:
    """Return the timing of the speeds at the samples between two rests, averaged."""
    mean = np.maximum(0.5 * (speed[1:] + speed[:-1]), MIN_SPEED)
    times_s = np.concatenate([[0.0], np.cumsum(np.diff(at_s) / mean)])
    window = max(round(smooth_s / SAMPLE_S), 1)
    count = int(np.ceil(times_s[-1] / SAMPLE_S)) + window + 1
    grid = np.arange(count, dtype=np.float64) * SAMPLE_S
    # Between two samples the acceleration is constant: the speed is linear in time.
    rate = np.interp(grid, times_s, speed, right=0.0)
    index = np.clip(np.searchsorted(times_s, grid, "right") - 1, 0, len(times_s) - 2)
    since = grid - times_s[index]
    raw = np.where(grid >= times_s[-1], at_s[-1], at_s[index] + 0.5 * (speed[index] + rate) * since)
    delayed = np.concatenate([np.full(window, at_s[0]), raw[:-window]])
    # The integral of the parameter over the window; its derivative is the difference of its ends.
    total = np.concatenate([[0.0], np.cumsum(0.5 * (raw[1:] + raw[:-1]) - at_s[0])])
    earlier = np.concatenate([np.zeros(window), total[:-window]])
    averaged = at_s[0] + (total - earlier) / window
    averaged[-1] = at_s[-1]
    speeds = (raw - delayed) / (window * SAMPLE_S)
    return Timing(grid, averaged, speeds, (0.0, float(grid[-1])))


def _joined(parts: list[Timing]) -> Timing:
    """Return the timing of all parts, one after the other."""
    begins_s = np.cumsum([0.0, *(part.times_s[-1] for part in parts)])
    firsts = zip(begins_s.tolist(), parts, strict=False)
    return Timing(
        np.concatenate([[0.0], *(begin_s + part.times_s[1:] for begin_s, part in firsts)]),
        np.concatenate([parts[0].at_s[:1], *(part.at_s[1:] for part in parts)]),
        np.concatenate([[0.0], *(part.speeds[1:] for part in parts)]),
        tuple(begins_s.tolist()),
    )
