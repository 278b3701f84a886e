"""Commanded motion of one axis: operation in progress, setpoint, and estimated profile."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robotd.api import (
    Operation,
    Profile,
    Segment,
    profile_to_position,
    profile_to_rest,
    profile_to_velocity,
)

_REST_VELOCITY_RAD_S = 0.01  # measured velocity of an axis at rest
_REST_FRAMES = 3  # frames at that velocity that make a standstill


class Activity:
    """Operation in progress. Begun by workers, ended by the control loop.

    Attributes:
        operation: as in the process image.
        complete: the last motion has reached its end.
        home_done: the axis has been homed since it was configured.
        streaming: setpoints come from ``AxisDriver.stream``.
        stops: number of stops that were requested, also of an idle axis.
        guided: moved by hand, or not held again since.
    """

    def __init__(self) -> None:
        self.operation = Operation.IDLE
        self.complete = self.home_done = self.streaming = self.guided = False
        self.stops = 0
        self._resting_frames = 0

    @property
    def is_idle(self) -> bool:
        return self.operation is Operation.IDLE

    def begin(self, operation: Operation) -> None:
        """Worker: ``operation`` runs from now on."""
        self.operation = operation
        self.streaming = operation is Operation.STREAM
        stops = operation is Operation.STOPPING
        self.guided = operation is Operation.GUIDING or (self.guided and stops)

    def begin_stop(self) -> None:
        """A stop replaces what runs; it ends at rest."""
        self.begin(Operation.STOPPING)
        self.complete = False
        self._resting_frames = 0

    def is_at_rest(self, velocity: float, turn: int, *, commanded: bool) -> bool:
        """Control loop: the motor has been slow for some frames.

        Args:
            velocity: measured, rad/s or m/s; of each ``turn``-th frame.
            commanded: the setpoint still moves, so the axis does not rest.
        """
        slow = not commanded and abs(velocity) < _REST_VELOCITY_RAD_S
        self._resting_frames = self._resting_frames + 1 if slow else 0
        return self._resting_frames >= _REST_FRAMES * turn


class HoldingBrake:
    """Brake of a drive, which needs ``release_s`` after operation was enabled. Control loop.

    Attributes:
        holds: until then, in which the drive ignores setpoints. Any thread.
    """

    def __init__(self, release_s: float) -> None:
        self._release_s, self._enabled_s = release_s, 0.0
        self.holds = release_s > 0.0

    def watch(self, period_s: float, *, powered: bool) -> None:
        """Count a period of a drive that answers; ``powered``: its operation is enabled."""
        if self._release_s:
            self._enabled_s = self._enabled_s + period_s if powered else 0.0
            self.holds = self._enabled_s < self._release_s


class Setpoint:
    """Position and velocity that the next frame carries, rad (or m) and seconds.

    Workers set targets and ramps while no motion is under way; the control loop follows them.

    Attributes:
        position, velocity: setpoint of the next frame; NaN before the first report of the drive.
        waits: a streamed setpoint has not been sent yet.
        target_velocity: velocity to reach along the ramps.
        target_counts: target of a profile position move, not wrapped.
        torque: setpoint of the cyclic torque mode, N·m or N.
        acceleration, deceleration: ramps of the velocity; the latter also of the running stop.
    """

    def __init__(self, ramp: float) -> None:
        self.position, self.velocity = math.nan, 0.0
        self.waits = False
        self.target_velocity = self.torque = 0.0
        self.target_counts = 0
        self.acceleration = self.deceleration = ramp

    def stand_at(self, position: float) -> None:
        """Stand at ``position``, without a velocity to reach and without a torque."""
        self.position = position
        self.velocity = self.target_velocity = self.torque = 0.0

    def brake(self, period_s: float) -> None:
        """Control loop: one period of a stop in a cyclic position mode."""
        self.velocity = towards(self.velocity, 0.0, self.deceleration * period_s)
        self.position += self.velocity * period_s

    def ramp(self, period_s: float) -> None:
        """Control loop: one period towards ``target_velocity``; a turn slows down to 0 first."""
        turns = self.velocity * self.target_velocity < 0.0
        goal = 0.0 if turns else self.target_velocity
        rate = self.deceleration if abs(goal) < abs(self.velocity) else self.acceleration
        self.velocity = towards(self.velocity, goal, rate * period_s)


class ProfileEstimate:
    """Estimated command of a profile that the drive runs by itself, rad (or m).

    A drive that makes the ramps itself reports its demand rarely and without a velocity. The
    profile is the trapezoid of CiA 402 (object 0x6086 = 0) with the ramps that it was given, so it
    is computed here too; it starts with the frame with which the command takes effect. Set by
    workers, advanced by the control loop.

    Args:
        max_deceleration: with which a drive brakes that is too fast to stop at its target.

    Attributes:
        position, velocity: command at the frame that was sent last.
        planned: target and profile of a move that begins when it is handed over to the drive.
    """

    def __init__(self, max_deceleration: float) -> None:
        self.position = self.velocity = 0.0
        self.planned: tuple[float, Profile] | None = None
        self._segments: Sequence[Segment] = ()
        self._elapsed_s = 0.0
        self._max_deceleration = max_deceleration

    @property
    def ended(self) -> bool:
        """True at the end of the profile."""
        return not self._segments or self._elapsed_s >= self._segments[-1].start_s

    def rest(self, position: float) -> None:
        """Stand at ``position``."""
        self._segments, self.position, self.velocity = (), position, 0.0

    def begin_planned(self) -> None:
        """Control loop: begin the planned move, with the frame that hands it over."""
        if self.planned is not None:
            state = self.position, self.velocity
            self._begin(profile_to_position(*state, *self.planned, self._max_deceleration))

    def run(self, velocity: float, acceleration: float, deceleration: float) -> None:
        """Change to the signed ``velocity``, which is then held."""
        ramps = acceleration, deceleration
        self._begin(profile_to_velocity(self.position, self.velocity, velocity, *ramps))

    def stop(self, deceleration: float) -> None:
        """Change to rest."""
        self._begin(profile_to_rest(self.position, self.velocity, deceleration))

    def advance(self, period_s: float) -> None:
        """Control loop: advance by the time between two frames."""
        segments = self._segments
        if not segments:
            return
        self._elapsed_s += period_s
        begun = [segment for segment in segments if segment.start_s <= self._elapsed_s]
        self.position, self.velocity = begun[-1].at(self._elapsed_s)

    def _begin(self, segments: Sequence[Segment]) -> None:
        self._elapsed_s = 0.0
        self._segments = segments


def towards(value: float, target: float, step: float) -> float:
    """Return ``value`` one ``step`` closer to ``target``, and not beyond it."""
    return min(target, value + step) if value < target else max(target, value - step)
