"""Points of a trajectory, and the checks that need no interpolation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise

import numpy as np

from robotd.arrays import FloatArray
from robotd.errors import unknown_name
from robotd.motion.joints import JointLimits, MotionState, TrajectoryRules
from robotd.motion.rate_bounds import RateBounds
from robotd.motion.rejection import distinct, reject, reject_joints

# Range of a ROS duration. Also keeps the powers of a time difference finite.
MAX_TIME_S = 2.0**31

# Largest velocity that counts as standstill in a goal: the rest of a zero that went through
# single precision.
REST_VELOCITY = 1.2e-7

Rows = Sequence[Sequence[float]]


@dataclass(frozen=True, eq=False)
class TrajectoryRequest:
    """Points of a goal, as given or checked and in axis order.

    Attributes:
        joint_names: m names.
        times_s: (n,) seconds from the start of the trajectory.
        positions: (n, m) rad or m.
        velocities, accelerations: (n, m), None where the client gave none.
        notes: sentences for the result's text, on values that are ignored.
        rate_bounds: of what the joints move, for changes of speed on the way; None: the joints'.
    """

    joint_names: tuple[str, ...]
    times_s: FloatArray
    positions: FloatArray
    velocities: FloatArray | None = None
    accelerations: FloatArray | None = None
    notes: tuple[str, ...] = ()
    rate_bounds: RateBounds | None = None

    @classmethod
    def from_rows(
        cls,
        joint_names: Sequence[str],
        times_s: Sequence[float],
        positions: Rows,
        velocities: Rows = (),
        accelerations: Rows = (),
    ) -> TrajectoryRequest:
        """Build a request from one row per point; empty rows: not given.

        Velocities and accelerations are used where every point has them. Those of some points
        only are ignored, with a note; accelerations also where velocities are ignored.

        Raises TrajectoryRejected: no joints, no positions, or a row of another length than
        ``joint_names``.
        """
        if not joint_names:
            raise reject_joints("the trajectory names no joints")
        width = len(joint_names)
        if positions and not any(len(row) for row in positions):
            raise reject("the points have no positions")
        position_table = _table("positions", positions, width)
        velocity_table, notes = _optional_table("velocities", velocities, width)
        acceleration_table, more_notes = _optional_table("accelerations", accelerations, width)
        if notes and acceleration_table is not None:
            acceleration_table = None
            more_notes = ("accelerations are ignored, because velocities are",)
        return cls(
            tuple(joint_names),
            np.array(times_s, np.float64),
            position_table,
            velocity_table,
            acceleration_table,
            (*notes, *more_notes),
        )

    def preceded(
        self, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
    ) -> TrajectoryRequest:
        """Return the points after one more at time 0.

        It has those of the values, each (m,), that the points have.
        """
        velocities, accelerations = self.velocities, self.accelerations
        return replace(
            self,
            times_s=np.concatenate([[0.0], self.times_s]),
            positions=np.vstack([position, self.positions]),
            velocities=None if velocities is None else np.vstack([velocity, velocities]),
            accelerations=(
                None if accelerations is None else np.vstack([acceleration, accelerations])
            ),
        )

    def select(self, rows: Sequence[int] | slice) -> TrajectoryRequest:
        """Return the points of ``rows`` alone."""
        return replace(
            self,
            times_s=self.times_s[rows],
            positions=self.positions[rows],
            velocities=None if self.velocities is None else self.velocities[rows],
            accelerations=None if self.accelerations is None else self.accelerations[rows],
        )


def _optional_table(
    label: str, rows: Rows, width: int
) -> tuple[FloatArray | None, tuple[str, ...]]:
    """Return the table if every point has a row, or None and a note."""
    given = [row for row in rows if len(row)]
    if given and len(given) < len(rows):
        _check_widths(label, rows, width)
        ignored = f"{label} are ignored: only {len(given)} of {len(rows)} points have them"
        return None, (ignored,)
    return (_table(label, rows, width) if given else None), ()


def _table(label: str, rows: Rows, width: int) -> FloatArray:
    _check_widths(label, rows, width, may_be_empty=False)
    flat = np.fromiter(chain.from_iterable(rows), np.float64, len(rows) * width)
    return flat.reshape(len(rows), width)


def _check_widths(label: str, rows: Rows, width: int, *, may_be_empty: bool = True) -> None:
    for index, row in enumerate(rows):
        if len(row) != width and (len(row) or not may_be_empty):
            raise reject(f"point {index}: {len(row)} {label} for {width} joints")


def arrange(
    request: TrajectoryRequest,
    limits: JointLimits,
    rules: TrajectoryRules,
    start: MotionState,
) -> TrajectoryRequest:
    """Check a request and order its joints; missing joints hold at ``start``.

    Raises TrajectoryRejected: joints unknown or doubled; joints missing that move, or where
    ``rules.allow_partial_joints`` is off; no points or more than ``rules.max_points``; lengths that
    do not fit; numbers that are not finite; a time that is negative or before the one of the point
    in front of it.
    """
    _check_names(request.joint_names, limits.names)
    _check_missing(request.joint_names, limits, rules, start)
    _check_shapes(request, rules.max_points)
    _check_times(request.times_s)
    given = [index for index, name in enumerate(limits.names) if name in request.joint_names]
    order = [request.joint_names.index(limits.names[index]) for index in given]

    def columns(table: FloatArray | None, held: FloatArray) -> FloatArray | None:
        if table is None:
            return None
        arranged = np.tile(held, (len(table), 1))
        arranged[:, given] = table[:, order]
        return arranged

    nothing = np.zeros(len(limits.names))
    positions = columns(request.positions, start.position)
    assert positions is not None  # noqa: S101 - for mypy
    points = TrajectoryRequest(
        limits.names,
        request.times_s,
        positions,
        columns(request.velocities, nothing),
        columns(request.accelerations, nothing),
        request.notes,
    )
    _check_finite("position", points.positions, points)
    _check_finite("velocity", points.velocities, points)
    _check_finite("acceleration", points.accelerations, points)
    return points


def _check_names(given: tuple[str, ...], names: tuple[str, ...]) -> None:
    if not given:
        raise reject_joints("the trajectory names no joints")
    for name in given:
        if name not in names:
            raise reject_joints(unknown_name("joint", name, names))
        if given.count(name) > 1:
            raise reject_joints(f"joint '{name}' is given {given.count(name)} times")


def _check_missing(
    given: tuple[str, ...], limits: JointLimits, rules: TrajectoryRules, start: MotionState
) -> None:
    missing = [index for index, name in enumerate(limits.names) if name not in given]
    if missing and not rules.allow_partial_joints:
        names = ", ".join(limits.names[index] for index in missing)
        raise reject_joints(
            f"missing joint {names}: every joint must be named"
            " (trajectory.allow_partial_joints_goal is false)"
        )
    for index in missing:
        if abs(start.velocity[index]) > REST_VELOCITY:
            raise reject_joints(
                f"missing joint {limits.names[index]}: it moves with"
                f" {start.velocity[index]:.3g} {limits.units[index]}/s and cannot be held; name"
                " it, or wait until it is at rest"
            )


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
    if not (times_s[0] >= 0.0 and (np.diff(times_s) >= 0.0).all() and times_s[-1] <= MAX_TIME_S):
        _explain_times(times_s.tolist())


def _explain_times(times_s: list[float]) -> None:
    for index, time_s in enumerate(times_s):
        if not 0.0 <= time_s <= MAX_TIME_S:
            raise reject(f"point {index}: time {time_s:g} s is outside 0 to {MAX_TIME_S:g} s")
    for index, (before_s, time_s) in enumerate(pairwise(times_s), start=1):
        if time_s < before_s:
            time, before = distinct(time_s, before_s, 6)
            raise reject(
                f"point {index}: time {time} s is not after the {before} s of point {index - 1}"
            )


def _check_finite(quantity: str, table: FloatArray | None, points: TrajectoryRequest) -> None:
    if table is None or np.isfinite(table).all():
        return
    row, column = np.argwhere(~np.isfinite(table))[0]
    raise reject(
        f"{points.joint_names[column]} at {points.times_s[row]:.3f} s (point {row}): "
        f"{quantity} is {table[row, column]}"
    )
