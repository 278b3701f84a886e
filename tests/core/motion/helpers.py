"""Joints, requests and strategies that the tests of motion share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from robotd.arrays import FloatArray
from robotd.control.groups.descriptor_limits import trajectory_rules
from robotd.descriptor import TrajectorySettings
from robotd.motion import (
    JointLimits,
    MotionState,
    Trajectory,
    TrajectoryRequest,
    plan,
)
from robotd.motion.extremes import PathPeaks
from robotd.motion.request import Rows

Table = Rows | FloatArray

NAMES = ("joint1", "joint2", "joint3")
SETTINGS = TrajectorySettings()


def limits(position: float = 3.0, velocity: float = 3.0, acceleration: float = 12.0) -> JointLimits:
    count = len(NAMES)
    return JointLimits(
        NAMES,
        np.full(count, -float(position)),
        np.full(count, float(position)),
        np.full(count, float(velocity)),
        np.full(count, float(acceleration)),
    )


UNLIMITED = limits(np.inf, np.inf, np.inf)


def request(
    times: ArrayLike,
    positions: Table,
    velocities: Table | None = None,
    accelerations: Table | None = None,
    names: Sequence[str] = NAMES,
) -> TrajectoryRequest:
    def table(rows: Table | None) -> FloatArray | None:
        return None if rows is None else np.atleast_2d(np.array(rows, float))

    return TrajectoryRequest(
        tuple(names),
        np.array(times, float),
        np.atleast_2d(np.array(positions, float)),
        table(velocities),
        table(accelerations),
    )


def rows(*values: float) -> list[list[float]]:
    """The same value for every joint, one row per value."""
    return [[value] * len(NAMES) for value in values]


def at_rest(position: float = 0.0) -> MotionState:
    return MotionState.at_rest(np.full(len(NAMES), float(position)))


def planned(
    asked: TrajectoryRequest,
    joints: JointLimits = UNLIMITED,
    start: MotionState | None = None,
    settings: TrajectorySettings = SETTINGS,
    recent_path: FloatArray | None = None,
) -> Trajectory:
    rules = trajectory_rules(settings, joints.units)
    return plan(asked, joints, rules, start or at_rest(), recent_path)


def peaks_of(trajectory: Trajectory) -> PathPeaks:
    return PathPeaks.of(trajectory.breaks, trajectory.coefficients)


def values(bound: float) -> st.SearchStrategy[float]:
    return st.floats(-bound, bound).map(lambda value: round(value, 4))


def tables(count: int, bound: float) -> st.SearchStrategy[FloatArray]:
    """(count, joints) arrays."""
    row = st.lists(values(bound), min_size=len(NAMES), max_size=len(NAMES))
    return st.lists(row, min_size=count, max_size=count).map(np.array)


@st.composite
def states(draw: st.DrawFn) -> MotionState:
    return MotionState(*(draw(tables(1, bound))[0] for bound in (2.0, 1.0, 5.0)))


@st.composite
def requests(draw: st.DrawFn) -> TrajectoryRequest:
    """Well-formed requests of every kind, with a first point that is later than 0."""
    count = draw(st.integers(1, 8))
    gaps = draw(st.lists(st.floats(0.01, 1.0), min_size=count, max_size=count))
    velocities = accelerations = None
    if draw(st.booleans()):
        velocities = draw(tables(count, 1.0))
        velocities[-1] = 0.0
        if draw(st.booleans()):
            accelerations = draw(tables(count, 5.0))
    return request(np.cumsum(gaps), draw(tables(count, 2.0)), velocities, accelerations)
