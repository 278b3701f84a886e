"""A trajectory as a client gave it, and the checks that need no robot state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.joints import JointLimits
from robotd.motion.rejection import reject, reject_joints

# What a ROS duration can hold. Also keeps the powers of a time difference in range.
LONGEST_S = 2.0**31

Rows = Sequence[Sequence[float]]


@dataclass(frozen=True, eq=False)
class TrajectoryRequest:
    """Points of a goal, unchecked, with joints in the client's order.

    Attributes:
        joint_names: m names.
        times_s: (n,) seconds from the start of the trajectory.
        positions: (n, m) rad or m.
        velocities, accelerations: (n, m), None where the client gave none.
    """

    joint_names: tuple[str, ...]
    times_s: FloatArray
    positions: FloatArray
    velocities: FloatArray | None = None
    accelerations: FloatArray | None = None

    @classmethod
    def from_rows(
        cls,
        joint_names: Sequence[str],
        times_s: Sequence[float],
        positions: Rows,
        velocities: Rows = (),
        accelerations: Rows = (),
    ) -> TrajectoryRequest:
        """From one row per point, as messages carry them. Empty rows mean "not given".

        Raises TrajectoryRejected when a row has another length than ``joint_names``, or when
        only some of the points carry velocities or accelerations.
        """
        width = len(joint_names)
        if positions and not any(len(row) for row in positions):
            raise reject("the points have no positions")
        return cls(
            tuple(joint_names),
            np.array(times_s, np.float64),
            _table("positions", positions, width),
            _optional_table("velocities", velocities, width),
            _optional_table("accelerations", accelerations, width),
        )


def _optional_table(label: str, rows: Rows, width: int) -> FloatArray | None:
    return _table(label, rows, width) if any(len(row) for row in rows) else None


def _table(label: str, rows: Rows, width: int) -> FloatArray:
    for index, row in enumerate(rows):
        if len(row) != width:
            raise reject(f"point {index}: {len(row)} {label} for {width} joints")
    flat = np.fromiter(chain.from_iterable(rows), np.float64, len(rows) * width)
    return flat.reshape(len(rows), width)


@dataclass(frozen=True, eq=False)
class Points:
    """Points in axis order, finite, in the order of time. Shapes (n,) and (n, m)."""

    times_s: FloatArray
    positions: FloatArray
    velocities: FloatArray | None
    accelerations: FloatArray | None

    def select(self, rows: Sequence[int] | slice) -> Points:
        """The points of ``rows`` alone."""
        return Points(
            self.times_s[rows],
            self.positions[rows],
            None if self.velocities is None else self.velocities[rows],
            None if self.accelerations is None else self.accelerations[rows],
        )


def arrange(request: TrajectoryRequest, limits: JointLimits, max_points: int) -> Points:
    """Check a request by itself and put its joints into axis order.

    Raises:
        TrajectoryRejected: joints unknown, missing or doubled; no points or more than
            ``max_points``; lengths that do not fit; numbers that are not finite; a time that
            is negative or before the one of the point in front of it.
    """
    order = _joint_order(request.joint_names, limits.names)
    _check_shapes(request, max_points)
    _check_times(request.times_s)
    points = Points(
        request.times_s,
        request.positions[:, order],
        None if request.velocities is None else request.velocities[:, order],
        None if request.accelerations is None else request.accelerations[:, order],
    )
    _check_finite("position", points.positions, points, limits)
    _check_finite("velocity", points.velocities, points, limits)
    _check_finite("acceleration", points.accelerations, points, limits)
    return points


def _joint_order(given: tuple[str, ...], names: tuple[str, ...]) -> list[int]:
    if not given:
        raise reject_joints("the trajectory names no joints")
    for name in given:
        if name not in names:
            raise reject_joints(f"unknown joint '{name}'; the joints are {', '.join(names)}")
        if given.count(name) > 1:
            raise reject_joints(f"joint '{name}' is given {given.count(name)} times")
    missing = [name for name in names if name not in given]
    if missing:
        raise reject_joints(f"missing joint {', '.join(missing)}: every joint must be named")
    return [given.index(name) for name in names]


def _check_shapes(request: TrajectoryRequest, max_points: int) -> None:
    count = len(request.times_s)
    if count == 0:
        raise reject("the trajectory has no points")
    if count > max_points:
        raise reject(f"{count} points exceed the limit of {max_points}")
    if request.accelerations is not None and request.velocities is None:
        raise reject("accelerations are given without velocities")
    expected = (count, len(request.joint_names))
    for label in ("positions", "velocities", "accelerations"):
        table = getattr(request, label)
        if table is not None and table.shape != expected:
            raise reject(
                f"{label} have the shape {table.shape}, {count} points of "
                f"{expected[1]} joints need {expected}"
            )


def _check_times(times_s: FloatArray) -> None:
    # Comparisons with NaN are false, so each test is written such that NaN fails it.
    if not (times_s[0] >= 0.0 and (np.diff(times_s) >= 0.0).all() and times_s[-1] <= LONGEST_S):
        _explain_times(times_s.tolist())


def _explain_times(times_s: list[float]) -> None:
    for index, time_s in enumerate(times_s):
        if not 0.0 <= time_s <= LONGEST_S:
            raise reject(f"point {index}: time {time_s:g} s is outside 0 to {LONGEST_S:g} s")
    for index, (before_s, time_s) in enumerate(pairwise(times_s), start=1):
        if time_s < before_s:
            raise reject(
                f"point {index}: time {time_s:g} s is not after the {before_s:g} s "
                f"of point {index - 1}"
            )


def _check_finite(
    quantity: str, table: FloatArray | None, points: Points, limits: JointLimits
) -> None:
    if table is None or np.isfinite(table).all():
        return
    row, column = np.argwhere(~np.isfinite(table))[0]
    raise reject(
        f"{limits.names[column]} at {points.times_s[row]:.3f} s (point {row}): "
        f"{quantity} is {table[row, column]}"
    )
