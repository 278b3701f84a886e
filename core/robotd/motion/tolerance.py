"""Tolerances of a goal: resolve and check them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.joints import JointLimits, TrajectoryRules
from robotd.motion.rejection import distinct, reject, reject_joints

_UNIT_SUFFIX = {"position": "", "velocity": "/s"}


@dataclass(frozen=True)
class JointTolerance:
    """Tolerance entry of a goal: 0: configured default, -1: no limit, > 0: the value."""

    name: str
    position: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0


@dataclass(frozen=True)
class Violation:
    """Joint out of tolerance ``kind``. ``str()`` is a sentence for ``error_string``."""

    kind: str
    joint: str
    quantity: str
    error: float
    limit: float
    time_s: float
    unit: str

    def __str__(self) -> str:
        error, limit = distinct(self.error, self.limit, 3)
        return (
            f"{self.joint} at {self.time_s:.3f} s: {self.quantity} error {error} "
            f"{self.unit} exceeds {self.kind} {limit} {self.unit}"
        )


class Tolerances:
    """Tolerances of one execution: defaults, overridden by those of a goal. One owner thread.

    Args:
        path, goal: entries of the goal message.
        goal_time_s: of the goal message; 0: the default, -1: no limit.

    Attributes:
        path, goal: limits per joint and quantity.
        goal_time_s: time after the end to get within ``goal``; inf waits without an end.
        notes: a sentence for each entry that is ignored (acceleration), for the result's text.

    Raises TrajectoryRejected: an unknown or doubled joint, or a value that is not a number or
    negative and not -1.
    """

    def __init__(
        self,
        limits: JointLimits,
        rules: TrajectoryRules,
        path: Iterable[JointTolerance] = (),
        goal: Iterable[JointTolerance] = (),
        goal_time_s: float = 0.0,
    ) -> None:
        self.path = JointBounds("path tolerance", limits, rules.path_tolerance, None, path)
        self.goal = JointBounds(
            "goal tolerance", limits, rules.goal_tolerance, rules.stopped_velocity, goal
        )
        self.goal_time_s = _resolve(goal_time_s, rules.goal_time_s, "goal time tolerance")
        self.notes = (*self.path.notes, *self.goal.notes)
        self._standstill = np.zeros(len(limits.names))

    def check_goal(
        self,
        time_s: float,
        position: FloatArray,
        actual_position: FloatArray,
        actual_velocity: FloatArray,
    ) -> Violation | None:
        """Return the worst goal violation; ``position`` is a standstill. Control loop."""
        return self.goal.check(time_s, position, actual_position, self._standstill, actual_velocity)


class JointBounds:
    """Bounds of one kind, (m,) arrays in rad or m; inf: unlimited.

    ``position``, ``velocity``: defaults (m,), inf for no limit; None is not a limit at all.
    Raises TrajectoryRejected: see ``Tolerances``.
    """

    def __init__(
        self,
        kind: str,
        joints: JointLimits,
        position: FloatArray,
        velocity: FloatArray | None,
        entries: Iterable[JointTolerance] = (),
    ) -> None:
        self.kind, self.names, self.units = kind, joints.names, joints.units
        names = joints.names
        self.position: FloatArray = position.copy()
        self.velocity: FloatArray = (
            np.full(len(names), np.inf) if velocity is None else velocity.copy()
        )
        self.notes = self._apply(list(entries))
        self._limited = tuple(
            bounds.tolist() if np.isfinite(bounds).any() else None
            for bounds in (self.position, self.velocity)
        )

    def check(
        self,
        time_s: float,
        position: FloatArray,
        actual_position: FloatArray,
        velocity: FloatArray,
        actual_velocity: FloatArray,
    ) -> Violation | None:
        """Return the worst violation, of position before velocity; None when all are within.

        Desired and actual values are (m,) and of the same moment, ``time_s`` on the trajectory.
        An actual value that is not a number is out of every tolerance. Control loop.
        """
        positions, velocities = self._limited
        if positions and _exceeds(position, actual_position, positions):
            return self._worst("position", position - actual_position, self.position, time_s)
        if velocities and _exceeds(velocity, actual_velocity, velocities):
            return self._worst("velocity", velocity - actual_velocity, self.velocity, time_s)
        return None

    def _apply(self, entries: list[JointTolerance]) -> tuple[str, ...]:
        notes: list[str] = []
        given: set[str] = set()
        for entry in entries:
            if entry.name not in self.names or entry.name in given:
                which = "joint given twice" if entry.name in given else "unknown joint"
                raise reject_joints(f"{self.kind}: {which}: '{entry.name}'")
            given.add(entry.name)
            joint, label = self.names.index(entry.name), f"{entry.name}: {self.kind} of"
            for name, bounds in (("position", self.position), ("velocity", self.velocity)):
                default = float(bounds[joint])
                bounds[joint] = _resolve(getattr(entry, name), default, f"{label} {name}")
            if np.isfinite(_resolve(entry.acceleration, np.inf, f"{label} acceleration")):
                notes.append(f"{label} acceleration is ignored: it is not measured")
        return tuple(notes)

    def _worst(
        self, quantity: str, deviation: FloatArray, bounds: FloatArray, time_s: float
    ) -> Violation:
        error = np.abs(deviation)
        # NaN counts as infinitely wrong, also where there is no limit to divide by.
        ratio = np.nan_to_num(error / bounds, nan=np.inf)
        joint = int(np.argmax(np.where(error <= bounds, -1.0, ratio)))
        return Violation(
            self.kind,
            self.names[joint],
            quantity,
            float(error[joint]),
            float(bounds[joint]),
            time_s,
            self.units[joint] + _UNIT_SUFFIX[quantity],
        )


def _exceeds(desired: FloatArray, actual: FloatArray, bounds: Sequence[float]) -> bool:
    """Return True when a joint is out of ``bounds``, as every NaN is.

    In plain floats: NumPy would take four functions that run nowhere else in a period.
    """
    found = actual.tolist()
    for joint, wanted in enumerate(desired.tolist()):
        if not abs(wanted - found[joint]) <= bounds[joint]:
            return True
    return False


def _resolve(value: float, default: float, label: str) -> float:
    if value == 0.0:
        return default
    if value == -1.0:
        return np.inf
    if value > 0.0:
        return value
    raise reject(f"{label} is {value:g}, must be positive, 0 (default) or -1 (no limit)")
