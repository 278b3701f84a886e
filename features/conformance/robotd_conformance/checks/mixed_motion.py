"""Motions of several kinds at once: each axis executes one of its own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from enum import StrEnum

import numpy as np

from robotd.api import Capability, CommandMode, FloatArray, Operation, ProcessImage
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import ramped

SHARE = 0.25  # of the speed of a profile
RAMP_S, MOVES_S = 0.1, 0.25  # of a stream; from the start of all motions to their end
POINTS = 40  # of a trajectory
SLOWEST_AXIS = 0.6  # speed of the last axis, to that of the first
SLOWEST, FASTEST = 0.7, 1.4  # measured speed of an axis in motion, to the commanded one
CERTAIN_RAD = 3.0 * SETTLED_RAD  # distance that shows a speed where values are coarse
TRAVEL_SHARE = 0.3  # of the travel, within MOVES_S
LASTS = 1.5  # times as long, setpoints go on at full speed


class Kind(StrEnum):
    """Kinds of motion, in the order in which neighbouring axes execute them."""

    MOVE = "move"
    JOG = "jog"
    STREAM = "position stream"
    VELOCITY_STREAM = "velocity stream"
    TRAJECTORY = "trajectory on the device"


BY_VELOCITY = (Kind.JOG, Kind.VELOCITY_STREAM)
STREAMED = (Kind.STREAM, Kind.VELOCITY_STREAM)
OPERATIONS = {
    Kind.MOVE: Operation.POSITION,
    Kind.JOG: Operation.VELOCITY,
    Kind.STREAM: Operation.STREAM,
    Kind.VELOCITY_STREAM: Operation.STREAM,
    Kind.TRAJECTORY: Operation.STREAM,
}


def kinds_of(harness: Harness) -> list[Kind]:
    """Return the kinds of motion that the device has."""
    on_device = harness.robot.axes.trajectories_on_device
    by_velocity = harness.can(Capability.VELOCITY_MODE)
    able = {
        Kind.MOVE: True,
        Kind.JOG: by_velocity,
        Kind.STREAM: not on_device,
        Kind.TRAJECTORY: on_device,
        Kind.VELOCITY_STREAM: by_velocity,
    }
    return [kind for kind in able if able[kind]]


def modes_of(harness: Harness) -> list[CommandMode]:
    """Return the command modes in which an axis holds its position."""
    able = harness.can(Capability.VELOCITY_MODE)
    return [CommandMode.POSITION, CommandMode.VELOCITY] if able else [CommandMode.POSITION]


class MixedMotion:
    """One motion per axis, all begun together by direct calls of the driver.

    Axis ``n`` executes ``kinds[(n + turn) % len(kinds)]``, at a speed of its own: forwards in even
    turns, backwards in odd ones. It begins half-way on the ``travel`` of the axis.

    Args:
        harness: enabled.
        turn: above.
        idle: axes that execute nothing.
        seconds: from the start of the motions to their end, at most.

    Attributes:
        kinds: of each axis.
        speeds: (n_axes,) signed.
        brakes_s: time from the start at which the setpoints slow down; inf: never.
        sends: setpoints are sent.
    """

    def __init__(
        self,
        harness: Harness,
        turn: int = 0,
        *,
        idle: Sequence[int] = (),
        seconds: float = MOVES_S,
    ) -> None:
        self._harness, self._turn, self._idle = harness, turn, idle
        able = kinds_of(harness)
        self.kinds = [able[(axis + turn) % len(able)] for axis in harness.all]
        travel = harness.travel()
        sizes = np.minimum(np.abs(harness.speeds(SHARE)), TRAVEL_SHARE * np.abs(travel) / seconds)
        sizes *= np.linspace(1.0, SLOWEST_AXIS, harness.count)  # none moves as another one
        self._sign = -1.0 if turn % 2 else 1.0
        self.speeds: FloatArray = self._sign * np.sign(travel) * sizes
        self.brakes_s, self.sends, self._seconds = math.inf, True, seconds
        self._began_ns = 0

    def axes(self, *kinds: Kind) -> list[int]:
        """Return the axes that execute one of ``kinds``."""
        return [
            axis for axis, kind in enumerate(self.kinds) if kind in kinds and axis not in self._idle
        ]

    def prepare(self) -> None:
        """Enable the axes, move them half-way on their travel, and set the command modes."""
        harness = self._harness
        harness.enable()
        start = harness.pose.position
        assert start is not None
        harness.move(harness.all, start + harness.travel(0.5))
        harness.rest()
        for axis in self.axes(*BY_VELOCITY):
            harness.robot.axes.set_command_mode(axis, CommandMode.VELOCITY)

    @contextmanager
    def running(self) -> Iterator[None]:
        """Begin all motions; setpoints are sent until the block ends, whatever ends the motions."""
        harness, driver = self._harness, self._harness.drivers.axes
        self._start = harness.image.position_command.copy()
        travel = harness.travel()
        targets = self._start + 0.45 * self._sign * travel
        profiles = [
            replace(harness.profile(axis), velocity=abs(float(speed)))
            for axis, speed in enumerate(self.speeds)
        ]
        if streamed := self.axes(*STREAMED):
            driver.begin_stream(streamed)
        self._began_ns = harness.clock.now_ns()
        with harness.each_period(self._send):
            for axis in self.axes(Kind.MOVE):
                driver.move(axis, float(targets[axis]), profiles[axis])
            for axis in self.axes(Kind.JOG):
                driver.jog(axis, replace(profiles[axis], velocity=float(self.speeds[axis])))
            if followers := self.axes(Kind.TRAJECTORY):
                distances = np.abs(targets - self._start)[followers]
                cruise_s = float((distances / np.abs(self.speeds[followers])).min())
                times_s = np.linspace(0.0, cruise_s + RAMP_S, POINTS)
                shares = np.array([ramped(time_s, RAMP_S, cruise_s)[0] for time_s in times_s])
                rows = self._start[followers] + shares[:, None] * self.speeds[followers]
                driver.follow(followers, times_s, rows)
            yield

    def require_motion(self) -> None:
        """Raise AssertionError unless each axis has moved, and shows its operation."""
        moved = np.sign(self.speeds) * (self._harness.image.position - self._start)
        for axis in self.axes(*Kind):
            assert moved[axis] > 2 * SETTLED_RAD, (
                f"axis {axis}: the {self.kinds[axis]} has not begun"
            )
        problems = self.problems(self.axes(*Kind), "all move")
        assert not problems, "; ".join(problems)

    def problems(self, axes: Sequence[int], what: str) -> list[str]:
        """Return what ``axes`` do that is not their motion at full speed, when ``what``."""
        velocity, errors = self._velocity(axes)
        image, found = self._harness.image, []
        for axis in axes:
            shown, kind = Operation(int(image.operation[axis])), self.kinds[axis]
            share, error = velocity[axis] / self.speeds[axis], errors[axis] / abs(self.speeds[axis])
            if shown is not OPERATIONS[kind]:
                found.append(f"axis {axis}: {shown.name} shown in a {kind} when {what}")
            elif not SLOWEST - error < share < FASTEST + error:
                found.append(f"axis {axis}: {share:.0%} of the speed of its {kind} when {what}")
        return found

    def _velocity(self, axes: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Return the measured velocities and their errors, (n_axes,) each.

        A device with slow feedback takes targets as slowly, and often in steps of its encoder: slow
        axes go from one to the next. There it is the mean over a distance of ``CERTAIN_RAD``.
        """
        harness = self._harness
        if not harness.drivers.axes.feedback_period_s:
            return harness.image.velocity.copy(), np.zeros(harness.count)
        first = harness.image.copy()
        harness.pass_time(CERTAIN_RAD / np.abs(self.speeds[axes]).min())
        last = harness.image.copy()
        elapsed_s = (last.fresh_ns - first.fresh_ns) * 1e-9
        error = 2.0 * SETTLED_RAD / elapsed_s
        return (last.position - first.position) / elapsed_s, np.full(harness.count, error)

    def finish(self) -> None:
        """End all motions as their commands do: arrive, slow to rest, end the stream."""
        harness, driver = self._harness, self._harness.drivers.axes
        self.brakes_s = (harness.clock.now_ns() - self._began_ns) * 1e-9 + 2 * harness.period_s
        for axis in self.axes(Kind.JOG):
            driver.jog(axis, replace(harness.profile(axis), velocity=0.0))
        harness.pass_time(RAMP_S + 4 * harness.period_s)
        if streamed := self.axes(*STREAMED):
            driver.end_stream(streamed)

    def _send(self, image: ProcessImage) -> None:
        """Control loop: velocity streams get no position, or a wrong one."""
        if not (self.sends and self.axes(*STREAMED)):
            return
        due_s = (self._harness.due_ns - self._began_ns) * 1e-9
        ends_s = min(self.brakes_s, LASTS * self._seconds)  # where nothing ends the motion
        distance_s, share = ramped(max(0.0, due_s), RAMP_S, ends_s)
        position = self._start + distance_s * self.speeds
        ignored = self.axes(*BY_VELOCITY)
        position[ignored] = math.nan if self._turn % 2 else self._harness.wrong_positions[ignored]
        self._harness.stream(position, share * self.speeds)
