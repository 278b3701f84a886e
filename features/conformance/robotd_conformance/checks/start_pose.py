"""Pose of the axes at the start of a run, to which every check returns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from robotd.api import AxisLimits, FloatArray, InvalidArgument, ProcessImage
from robotd.api.models import RobotDescriptor

TRAVEL_RAD = 0.3  # the farthest that a check moves an axis; m for a linear one
MAX_EXCURSION_RAD = 0.45  # at which a run ends, by default: checks that stop a move overshoot
START_RAD = 2e-3  # largest error of an axis that has arrived; m for a linear one
TOLERANCE_SHARE = 0.1  # of the travel: more could not be told from a move that was not made
ROOM = 0.8  # share of the distance to a position limit that is the travel at most
MARGIN, MARGIN_SHARE = 0.02, 0.05  # rad or m that commands keep from limits; share of a small room
START_MARGIN, START_SHARE = 0.06, 0.15  # the same of the start pose


class StartPose:
    """First known position of each axis, and how far the checks went from it.

    An axis that is near to a limit starts a little farther inside.

    Args:
        max_excursion: rad or m from the start pose, at which a run on hardware ends; None: 0.45.
        ranges: names of axes, and the positions that the surroundings (floor, table) leave them.

    Raises InvalidArgument: the excursion is not more than the travel of one check.

    Attributes:
        max_excursion: rad or m, at which a run on hardware ends.
        position: (n_axes,) rad or m; None: not known yet.
        left: (n_axes,) where the last connection has left the axes; None: not known.
        farthest: (n_axes,) largest distance from ``position`` that was measured.
        exceeded: text of the first axis beyond ``max_excursion``; "" without one.
        misplaced: why no check can begin where the axes are; "" where they can.
        room: (2, n_axes) lowest and highest position that is commanded.
        tolerance: (n_axes,) largest distance of an axis at rest from the target of its move.
        units: of the axes, "rad" or "m".
        counts: distances count; not in a check that changes what a position means.
    """

    def __init__(
        self,
        max_excursion: float | None = None,
        ranges: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    ) -> None:
        self.max_excursion = MAX_EXCURSION_RAD if max_excursion is None else max_excursion
        if not self.max_excursion > TRAVEL_RAD:
            raise InvalidArgument(
                f"--max-excursion is {max_excursion}, must be more than {TRAVEL_RAD:g} rad, the"
                " travel of one check"
            )
        self._ranges = dict(ranges)
        self.position: FloatArray | None = None
        self.left: FloatArray | None = None
        self.farthest: FloatArray = np.zeros(0)
        self.exceeded = self.misplaced = ""
        self.counts = True
        self.room: FloatArray = np.zeros((2, 0))
        self.units: list[str] = []
        self.tolerance: FloatArray = np.zeros(0)
        self._travel: FloatArray = np.zeros(0)

    def begin(
        self,
        position: FloatArray,
        limits: Sequence[AxisLimits],
        names: Sequence[str],
        tolerance: FloatArray,
    ) -> None:
        """Take ``position`` (n_axes,) as the start pose; later calls have no effect.

        Args:
            tolerance: (n_axes,) goal tolerances that the robot's file states; 0: none.

        Raises InvalidArgument for a range of an axis that does not exist, or without the start.
        """
        if self.position is None:
            self._names, self.units = names, [limit.unit for limit in limits]
            limits = self._narrowed(limits)
            try:
                self._check_ranges(position, limits)
            except InvalidArgument as error:
                self.misplaced = str(error)
                raise
            self._allowed = np.array([(limit.lower, limit.upper) for limit in limits]).T
            self.room = _inset(self._allowed, MARGIN, MARGIN_SHARE)
            start = np.clip(position, *_inset(self._allowed, START_MARGIN, START_SHARE))
            self.farthest = np.zeros(len(position))
            self._travel = np.array(
                [
                    _signed_travel(axis, float(start[axis]), self.room[:, axis], len(limits))
                    for axis in range(len(limits))
                ]
            )
            most = TOLERANCE_SHARE * np.abs(self._travel)
            self.tolerance = np.maximum(START_RAD, np.minimum(tolerance, most))
            self.position = start

    def is_start(self, measured: FloatArray) -> bool:
        """Return True where axes that rest at ``measured`` (n_axes,) are at the start pose."""
        if self.position is None:
            return False
        return bool((np.abs(measured - self.position) <= self.tolerance).all())

    def is_commanded(self, command: FloatArray) -> bool:
        """Return True where ``command`` (n_axes,) is the start pose, however stiff the axes are."""
        return self.position is not None and self.away(command) <= START_RAD

    def away(self, position: FloatArray) -> float:
        """Return the largest distance of an axis from the start pose, once it is known."""
        assert self.position is not None
        return float(np.abs(position - self.position).max())

    def travel(self, share: float) -> FloatArray:
        """Return (n_axes,) signed distances, all different; always to the same side."""
        return self._travel * share

    def track(self, image: ProcessImage) -> None:
        """Note how far the axes are from the start pose. Control loop."""
        if self.position is None or not self.counts:
            return
        away = np.abs(image.position - self.position)
        np.fmax(self.farthest, away, out=self.farthest)
        lower, upper = self._allowed
        outside = (image.position < lower - START_RAD) | (image.position > upper + START_RAD)
        if self._ranges and outside.any() and not self.exceeded:
            axis = int(outside.argmax())
            self.exceeded = (
                f"{self._names[axis]} is at {image.position[axis]:.3f} {self.units[axis]}; its"
                f" --range is {lower[axis]:g} to {upper[axis]:g} {self.units[axis]}"
            )
        if (away > self.max_excursion).any() and not self.exceeded:
            axis = int(np.nanargmax(away))
            unit = self.units[axis]
            self.exceeded = (
                f"{self._names[axis]} is {away[axis]:.3f} {unit} from its start pose;"
                f" --max-excursion is {self.max_excursion:g} {unit}"
            )

    def _narrowed(self, limits: Sequence[AxisLimits]) -> list[AxisLimits]:
        narrow = []
        for name, limit in zip(self._names, limits, strict=True):
            lower, upper = self._ranges.get(name, (-math.inf, math.inf))
            narrow.append(
                replace(limit, lower=max(lower, limit.lower), upper=min(upper, limit.upper))
            )
        return narrow

    def _check_ranges(self, position: FloatArray, limits: Sequence[AxisLimits]) -> None:
        if unknown := set(self._ranges) - set(self._names):
            raise InvalidArgument(
                f"--range names {', '.join(sorted(unknown))}; the axes are {', '.join(self._names)}"
            )
        for axis, (name, limit) in enumerate(zip(self._names, limits, strict=True)):
            if name in self._ranges and not limit.lower <= position[axis] <= limit.upper:
                raise InvalidArgument(
                    f"{name} is at {position[axis]:z.3f} {limit.unit}, outside of its --range"
                    f" {limit.lower:g} to {limit.upper:g} {limit.unit}: move it there first"
                )

    def refusal(self, axis: int, what: str) -> str:
        """Return why the checks do not command ``what`` to an axis."""
        lower, upper = self.room[:, axis]
        bounds = "its --range" if self._names[axis] in self._ranges else "its position limits"
        return (
            f"{what} is not commanded to {self._names[axis]}: outside of {lower:.4g} to {upper:.4g}"
            f" {self.units[axis]}, {bounds} less a margin"
        )

    def summary(self) -> str:
        """Return which axis went farthest; "" while no start pose is known."""
        if self.position is None:
            return ""
        axis = int(self.farthest.argmax())
        return (
            f"farthest from the start pose: {self._names[axis]}, {self.farthest[axis]:.3f}"
            f" {self.units[axis]} (--max-excursion {self.max_excursion:g})"
        )


def stated_tolerance(robot: RobotDescriptor, limits: Sequence[AxisLimits]) -> FloatArray:
    """Return (n_axes,) the goal tolerances in the robot's file; 0 where it has none.

    The defaults would hide errors of drives that are stiff.
    """
    stated = robot.trajectory.model_dump(exclude_unset=True)
    return np.array([stated.get(f"goal_tolerance_{limit.unit}", 0.0) for limit in limits])


def parse_range(text: str) -> tuple[str, tuple[float, float]]:
    """Read ``NAME=LOWER:UPPER``. Raises InvalidArgument."""
    name, equals, both = text.partition("=")
    lower, colon, upper = both.partition(":")
    try:
        bounds = float(lower), float(upper)
    except ValueError:
        bounds = math.nan, math.nan
    if not (name and equals and colon and bounds[0] < bounds[1]):
        raise InvalidArgument(f"--range {text!r} is not NAME=LOWER:UPPER, such as joint2=-0.2:0.6")
    return name, bounds


def _inset(allowed: FloatArray, margin: float, share: float) -> FloatArray:
    """Return ``allowed`` (2, n_axes) less a margin on both sides, smaller in a small room."""
    margins = np.minimum(margin, share * (allowed[1] - allowed[0]))
    return np.array([allowed[0] + margins, allowed[1] - margins])


def _signed_travel(axis: int, start: float, room: FloatArray, count: int) -> float:
    """Return the signed travel of an axis: sides alternate where both have room for it."""
    size = TRAVEL_RAD * float(np.linspace(1.0, 0.5, count)[axis])
    up, down = room[1] - start, start - room[0]
    sign = -1.0 if axis % 2 else 1.0
    if (up if sign > 0.0 else down) <= size / ROOM:  # checks go on a little when they stop
        sign = 1.0 if up >= down else -1.0
    return float(sign * min(size, ROOM * max(up, down)))
