"""Curve through the points of a recorded path, and the few points that keep to a recording.

Between two points each joint follows a cubic that never leaves the range between them (Fritsch and
Carlson, "Monotone Piecewise Cubic Interpolation", SIAM J. Numer. Anal. 17(2), 1980): a joint that
rests at two points rests between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robotd.api import FloatArray, IntArray, InvalidArgument
from robotd_tool_space.paths.joint_path import hermite

TOLERANCE = {"rad": 0.005, "m": 0.0005}  # of the points' curve from the recorded positions
MEAN_S = 0.1  # of the moving average over a recording
MEAN_SHARE, CURVE_SHARE = 0.7, 0.3  # of the tolerance: of that average, and of the points' curve
REST_SAMPLES = 5  # at an end of a recording, whose median is where it rests
STEP = 0.5  # of the tolerance, between two samples of a curve; of a very long one it is more
SHORTEST_STEP = 0.1  # of the tolerance; samples nearer to each other are one place
PAUSE_S = 0.5  # without motion by ``SHORTEST_STEP``, that is kept as a stop
SLOWEST = 1e-3  # along the path, rad/s, where nothing but pauses was recorded
CORNER = 0.7  # cosine of the angle between two steps, 45°, that is turned at rest
MIN_STEPS = 12  # between two stops
MAX_SAMPLES = 20_000


def tolerances(units: Sequence[str]) -> FloatArray:
    """Return the tolerance (n,) of each joint by its unit."""
    return np.array([TOLERANCE[unit] for unit in units])


def thinned(
    times_s: FloatArray, positions: FloatArray, tolerance: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the points of a recording that its curve needs, from time 0, and its deviation.

    The curve is within ``tolerance`` of each recorded position at its time. Standing still at both
    ends is left out; noise is averaged over ``MEAN_S``, or less where that would deviate more.

    Args:
        times_s: (k,) increasing.
        positions: (k, n), rad or m.
        tolerance: (n,).

    Returns times (p,), positions (p, n) and the largest deviation (n,) of each joint.
    Raises InvalidArgument: the joints did not move.
    """
    smooth = _averaged(times_s, positions, tolerance)
    rests = [np.median(part, axis=0) for part in (smooth[:REST_SAMPLES], smooth[-REST_SAMPLES:])]
    first = _standing(smooth, rests[0], tolerance)
    last = len(smooth) - 1 - _standing(smooth[::-1], rests[1], tolerance)
    if first >= last:
        raise InvalidArgument("nothing was recorded: the joints have not moved")
    before, after = first > 0, last < len(smooth) - 1
    positions, smooth = positions[first : last + 1], smooth[first : last + 1].copy()
    times_s = times_s[first : last + 1] - times_s[first]
    if before:
        smooth[0] = rests[0]
    if after:
        smooth[-1] = rests[1]
    kept = np.array([0, len(times_s) - 1])
    while True:
        off = np.abs(interpolated(times_s[kept], smooth[kept], times_s) - smooth) / tolerance
        worst = off.max(axis=1)
        added = [
            begin + int(worst[begin:end].argmax())
            for begin, end in zip(kept[:-1], kept[1:] + 1, strict=True)
            if worst[begin:end].max() > CURVE_SHARE
        ]
        if not added:
            break
        kept = np.unique([*kept, *added])
    curve = interpolated(times_s[kept], smooth[kept], times_s)
    deviation: FloatArray = np.abs(curve - positions).max(axis=0)
    return times_s[kept], smooth[kept], deviation


def _standing(positions: FloatArray, rest: FloatArray, tolerance: FloatArray) -> int:
    """Return the last of (k, n) positions, from the first one on, that is at ``rest`` (n,)."""
    moved = (np.abs(positions - rest) > CURVE_SHARE * tolerance).any(axis=1)
    return max(int(moved.argmax()) - 1, 0) if moved.any() else len(positions) - 1


def _averaged(times_s: FloatArray, positions: FloatArray, tolerance: FloatArray) -> FloatArray:
    """Return the moving average of positions, within ``MEAN_SHARE`` of the tolerance."""
    period_s = (times_s[-1] - times_s[0]) / max(len(times_s) - 1, 1)
    half = round(0.5 * MEAN_S / period_s) if period_s > 0.0 else 0
    while half > 0:
        # By the odd reflection the mean keeps both ends.
        ends = np.pad(positions, ((half, half), (0, 0)), "reflect", reflect_type="odd")
        total = np.cumsum(np.vstack([np.zeros_like(ends[:1]), ends]), axis=0)
        width = 2 * half + 1
        mean: FloatArray = (total[width:] - total[:-width]) / width
        if (np.abs(mean - positions) <= MEAN_SHARE * tolerance).all():
            return mean
        half //= 2
    return positions


def interpolated(knots_s: FloatArray, positions: FloatArray, times_s: FloatArray) -> FloatArray:
    """Return the curve (k, n) through points (p, n) at times (k,); it rests at its ends."""
    widths = np.diff(knots_s)[:, None]
    slopes = np.diff(positions, axis=0) / widths
    velocities = np.zeros_like(positions)
    before, after = slopes[:-1], slopes[1:]
    of_before, of_after = widths[:-1] + 2.0 * widths[1:], 2.0 * widths[:-1] + widths[1:]
    goes_on = before * after > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (of_before + of_after) / (of_before / before + of_after / after)
    velocities[1:-1] = np.where(goes_on, mean, 0.0)
    index = np.clip(np.searchsorted(knots_s, times_s, "right") - 1, 0, len(knots_s) - 2)
    width = widths[index]
    part = (times_s - knots_s[index])[:, None] / width
    return hermite(
        part,
        positions[index],
        positions[index + 1],
        width * velocities[index],
        width * velocities[index + 1],
    )


@dataclass(frozen=True, eq=False)
class PathCurve:
    """Joint positions of a path by the distance along it; see ``Curve`` of tool space.

    Attributes:
        at_s: (k,) distance, with a joint's tolerance counted as that of an angle; rad.
        positions: (k, n), rad or m.
        slopes: (k, n) derivatives by the distance, at a stop those after it.
        arriving: (k, n) derivatives before each sample.
        rates: (k,) recorded speed along the path, rad/s.
        times_s: (k,) recorded times.
        pauses_s: recorded time at rest by sample, of the inner stops.
    """

    at_s: FloatArray
    positions: FloatArray
    slopes: FloatArray
    arriving: FloatArray
    rates: FloatArray
    times_s: FloatArray
    pauses_s: dict[int, float]

    @classmethod
    def through(
        cls,
        knots_s: FloatArray,
        points: FloatArray,
        tolerance: FloatArray,
        begin_s: float = 0.0,
    ) -> PathCurve:
        """Return the curve through points (p, n) at times (p,), from ``begin_s`` on.

        Raises InvalidArgument: nothing moves from there on.
        """
        times_s, positions = _sampled(knots_s, points, tolerance, begin_s)
        scale = TOLERANCE["rad"] / tolerance
        steps = np.diff(positions, axis=0) * scale
        lengths = np.linalg.norm(steps, axis=1)
        gaps_s = np.diff(times_s)
        rates = lengths / gaps_s
        paused = gaps_s > PAUSE_S
        rates[paused] = rates[~paused].max(initial=SLOWEST)
        turns = (steps[:-1] * steps[1:]).sum(axis=1) < CORNER * lengths[:-1] * lengths[1:]
        stops = np.flatnonzero(turns | paused[1:]) + 1
        at_s = np.concatenate([[0.0], np.cumsum(lengths)])
        fastest = np.maximum(np.append(rates, rates[-1]), np.append(rates[:1], rates))
        edges = np.array([0, *stops, len(at_s) - 1])
        raw = cls(at_s, positions, *_slopes(at_s, positions, edges), fastest, times_s, {})
        places = [
            np.linspace(at_s[first], at_s[last], max(last - first, MIN_STEPS) + 1)[1:]
            for first, last in pairwise(edges.tolist())
        ]
        even = np.concatenate([[0.0], *places])
        index = np.cumsum([0, *map(len, places)])
        placed, _ = raw.exact(even)
        waits_s = np.where(paused[stops], gaps_s[stops], 0.0).tolist()
        return cls(
            even,
            placed,
            *_slopes(even, placed, index),
            np.interp(even, at_s, fastest),
            np.interp(even, at_s, times_s),
            dict(zip(index[1:-1].tolist(), waits_s, strict=True)),
        )

    def exact(self, at_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and derivatives by the distance, (m, n) each, at (m,) places."""
        index = np.clip(np.searchsorted(self.at_s, at_s, "right") - 1, 0, len(self.at_s) - 2)
        width = (self.at_s[index + 1] - self.at_s[index])[:, None]
        part = (at_s - self.at_s[index])[:, None] / width
        leave, arrive = self.slopes[index], self.arriving[index + 1]
        start, end = self.positions[index], self.positions[index + 1]
        positions = hermite(part, start, end, width * leave, width * arrive)
        return positions, leave + part * (arrive - leave)


def _slopes(
    at_s: FloatArray, positions: FloatArray, edges: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives (k, n) after and before each sample of parts between ``edges``."""
    leaving, arriving = np.empty_like(positions), np.empty_like(positions)
    for first, last in pairwise(edges.tolist()):
        part = slice(first, last + 1)
        slopes = np.gradient(positions[part], at_s[part], axis=0)
        leaving[part], arriving[first + 1 : last + 1] = slopes, slopes[1:]
    arriving[0] = leaving[0]
    return leaving, arriving


def _sampled(
    knots_s: FloatArray, points: FloatArray, tolerance: FloatArray, begin_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return times (k,) and positions (k, n) of places that are apart from each other."""
    distances = np.abs(np.diff(points, axis=0) / tolerance).max(axis=1)
    step = max(STEP, distances.sum() / MAX_SAMPLES)
    counts = np.maximum(np.ceil(2.0 * distances / step), 4).astype(int)
    parts = [
        np.linspace(first_s, last_s, count, endpoint=False)
        for first_s, last_s, count in zip(knots_s[:-1], knots_s[1:], counts, strict=True)
    ]
    times_s = np.concatenate([*parts, knots_s[-1:]])
    times_s = np.concatenate([[begin_s], times_s[times_s > begin_s]])
    positions = interpolated(knots_s, points, times_s)
    kept, scaled = [0], positions / tolerance
    for index in range(1, len(times_s)):
        if np.abs(scaled[index] - scaled[kept[-1]]).max() >= SHORTEST_STEP:
            kept.append(index)
    if len(kept) == 1:
        raise InvalidArgument("the joints do not move on this part of the path")
    end = len(times_s) - 1
    if kept[-1] != end:  # the end of the path counts, not the last place before it
        kept = [*(kept[:-1] if len(kept) > 2 else kept[:1]), end]
    return times_s[kept], positions[kept]
