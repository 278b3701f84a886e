"""Path from the present state through the points of a goal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.extremes import derivative, extremes
from robotd.motion.interpolation import Interpolation, interpolate
from robotd.motion.joints import JointLimits, MotionState, TrajectoryRules
from robotd.motion.path_checks import MIN_SPACING_S, ROUNDED_SPACING_S, SAME_POSITION
from robotd.motion.path_ends import blend_in
from robotd.motion.rejection import distinct, reject
from robotd.motion.request import REST_VELOCITY, TrajectoryRequest
from robotd.motion.trajectory import Trajectory


class PathBuilder:
    """Builds the path of one goal: direct, or with a blended start.

    Args:
        points: merged, in axis order.
        start: commanded state at time 0.
        recent_path: (w, m) positions that the joints had or will have, at any of which a
            first point at time 0 may be; None: at ``start`` only.
    """

    def __init__(
        self,
        points: TrajectoryRequest,
        start: MotionState,
        limits: JointLimits,
        rules: TrajectoryRules,
        recent_path: FloatArray | None,
    ) -> None:
        self._points = points
        self._start = start
        self._limits = limits
        self._rules = rules
        begins = start.position[None]
        self._begins = begins if recent_path is None else np.vstack([begins, recent_path])
        self._stands = bool((np.abs(start.velocity) <= REST_VELOCITY).all())

    def build(self) -> Trajectory:
        """Return the path.

        A first point at time 0 (or less than 1 ms later) within the start tolerance begins the
        client's path, and the deviation of the start from it is blended in. Any other first
        point is reached from the start in its own time; where that time is too short for the
        limits and the path, extended back to time 0, passes the start, it is blended too.

        Raises TrajectoryRejected: a first point at time 0 beyond the start tolerance; an end that
        leaves no time to stop; numbers too large to compute with.
        """
        points = self._points
        if points.times_s[0] < ROUNDED_SPACING_S:
            self._check_first_point()
            if len(points.times_s) == 1:
                return self._hold()
            times_s = points.times_s.copy()
            times_s[0] = 0.0
            return self._blended(replace(points, times_s=times_s))
        direct = self._direct()
        if len(points.times_s) == 1 or not self._begins_too_fast(direct):
            return direct
        extended = self._extended()
        return self._blended(extended) if self._nearest(extended)[1] <= 0.0 else direct

    def _nearest(self, points: TrajectoryRequest) -> tuple[FloatArray, float]:
        """Return the position nearest to the first point, and how far beyond the tolerance."""
        excess = np.abs(self._begins - points.positions[0]) - self._rules.start_tolerance
        worst = excess.max(axis=1)
        row = int(np.argmin(worst))
        return self._begins[row], float(worst[row])

    def _check_first_point(self) -> None:
        nearest, excess = self._nearest(self._points)
        if excess <= 0.0:
            return
        tolerances = self._rules.start_tolerance
        first = self._points.positions[0]
        joint = int(np.argmax(np.abs(first - nearest) / tolerances))
        tolerance = float(tolerances[joint])
        name, unit = self._limits.names[joint], self._limits.units[joint]
        distance, limit = distinct(abs(float(first[joint] - nearest[joint])), tolerance)
        stood = np.ptp(self._begins, axis=0).max() <= SAME_POSITION
        where = "the present position" if stood else "the recent path, at"
        raise reject(
            f"{name} at 0.000 s: first point {first[joint]:.5g} is {distance} {unit} away from "
            f"{where} {nearest[joint] + 0.0:.5g}, start tolerance {limit} {unit}"
        )

    def _hold(self) -> Trajectory:
        """Return standstill for the shortest segment: the goal is reached already."""
        start, limits = self._start, self._limits
        if not self._stands:
            joint = int(np.argmax(np.abs(start.velocity)))
            raise reject(
                f"{limits.names[joint]} at {self._points.times_s[-1]:.3f} s: the last point leaves "
                f"no time to stop from {start.velocity[joint]:.5g} {limits.units[joint]}/s"
            )
        times_s = np.array([0.0, MIN_SPACING_S])
        return self._path(
            TrajectoryRequest(limits.names, times_s, np.array([start.position] * 2)),
            start.velocity,
        )

    def _direct(self) -> Trajectory:
        """Return the path whose first knot is the start."""
        points, start = self._points, self._start
        present = np.abs(points.positions[0] - start.position).max() <= SAME_POSITION
        if self._stands and present and points.velocities is None and len(points.times_s) > 1:
            return self._dwelling()
        knots = points.preceded(start.position, start.velocity, start.acceleration)
        return self._path(knots, start.velocity)

    def _dwelling(self) -> Trajectory:
        """Return standstill until the first point, and from there the spline."""
        points, start = self._points, self._start
        rest = np.zeros_like(start.position)
        dwell = replace(
            points.select([0, 0]),
            times_s=np.array([0.0, points.times_s[0]]),
            positions=np.vstack([start.position, points.positions[0]]),
        )
        moved = self._path(points, rest)
        return replace(
            moved,
            kind=Interpolation.BLENDED,
            breaks=np.concatenate([[0.0], moved.breaks]),
            coefficients=np.concatenate([interpolate(dwell, rest)[1], moved.coefficients]),
        )

    def _extended(self) -> TrajectoryRequest:
        """Return the points with one more at time 0, from which they seem to come.

        From rest they come with a constant acceleration, in motion with a constant velocity.
        """
        points = self._points
        velocities, accelerations = points.velocities, points.accelerations
        slope = self._first_slope(points) if velocities is None else velocities[0]
        mean, velocity = (slope / 2.0, np.zeros_like(slope)) if self._stands else (slope, slope)
        acceleration = np.zeros_like(slope) if accelerations is None else accelerations[0]
        return points.preceded(
            points.positions[0] - mean * points.times_s[0], velocity, acceleration
        )

    def _first_slope(self, points: TrajectoryRequest) -> FloatArray:
        """Return the velocity (m,) at the first point, of the parabola through three points."""
        lengths = np.diff(points.times_s[:3])
        slopes = np.diff(points.positions[:3], axis=0) / lengths[:, None]
        first: FloatArray = slopes[0]
        if len(slopes) > 1:
            first = first + (slopes[0] - slopes[1]) * lengths[0] / lengths.sum()
        return first

    def _blended(self, points: TrajectoryRequest) -> Trajectory:
        """Return the path through ``points``, the first at time 0, reached from the start."""
        begin = self._start.velocity
        if not self._stands and len(points.times_s) > 2:
            begin = self._first_slope(points)
        path = self._path(points, begin)
        coefficients, end_s = blend_in(path, self._start, self._limits, self._rules.velocity_margin)
        if end_s == 0.0:
            return path
        return replace(path, kind=Interpolation.BLENDED, coefficients=coefficients)

    def _path(self, knots: TrajectoryRequest, start_velocity: FloatArray) -> Trajectory:
        velocities = knots.velocities
        if velocities is not None:
            velocities = velocities.copy()
            velocities[-1, np.abs(velocities[-1]) <= REST_VELOCITY] = 0.0
        knots = replace(knots, velocities=velocities)
        kind, coefficients = interpolate(knots, start_velocity)
        return Trajectory(
            names=self._limits.names,
            kind=kind,
            breaks=knots.times_s,
            coefficients=coefficients,
            final_position=knots.positions[-1].copy(),
        )

    def _begins_too_fast(self, path: Trajectory) -> bool:
        """True where the first segment exceeds what the limits and their margin allow."""
        margin = self._rules.acceleration_margin
        second = derivative(derivative(path.coefficients[:1]))
        lowest, highest = extremes(path.breaks[:2], second)
        peak = np.maximum(highest.value, -lowest.value)
        return bool((peak > self._limits.acceleration * (1.0 + (margin or 0.0))).any())
