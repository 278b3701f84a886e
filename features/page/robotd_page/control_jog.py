"""Hold-to-run jog of single joints: a joint moves while heartbeats of its button arrive."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from robotd.control.joint_group import JointGroup
from robotd.control.joint_stream import JointStream
from robotd.errors import InvalidArgument, NotReady, RobotdError, unknown_name
from robotd.events import noted, sent_by
from robotd.motion.stopping import stoppable_velocity
from robotd.robot import Robot
from robotd_page.control_commands import Finite, Message, Seen

HEARTBEAT_S = 0.02  # interval at which a page repeats the message of a button that is held
TIMEOUT_S = 0.06  # age of the last heartbeat at which the joint slows to rest
STOP_S = 0.15  # from the last heartbeat to standstill
LATE_PERIODS = 3  # of the control loop, until it sees the silence and the drive has followed
REACHED = "reached"
RELEASED = "released"
CLOSED = "connection closed"
REACHED_TOLERANCE = 1e-6  # rad or m


Command = Callable[[JointStream], None]
"""Sends a setpoint to a stream."""


class Jog(Message):
    """Heartbeat of a button that is held, or of a step that is under way.

    Attributes:
        hold: number that the client counts up with each press.
        joint: name.
        velocity: signed, or positive with a step; rad/s or m/s.
        step: signed distance from where the joint is commanded now, rad or m; None: no end.
        seen: as in ``Command``; that of the first heartbeat counts.
    """

    type: Literal["jog"]
    hold: Annotated[int, Field(ge=1)]
    joint: str
    velocity: Finite
    step: Finite | None = None
    seen: Seen | None = None


class Release(Message):
    """End of a hold.

    Attributes:
        hold: as in ``Jog``.
        reason: as in the log.
    """

    type: Literal["release"]
    hold: int
    reason: Literal["released", "window lost focus", "tab hidden", "page left", "page stalled"]


@dataclass(frozen=True)
class JogEnd:
    """End of a hold.

    Attributes:
        hold: as in ``Jog``.
        is_wanted: it was released, or reached its target.
        is_silent: its heartbeats came late, or none came.
        reason: text.
        remaining: signed distance to the target of a step, rad or m; None without a target.
    """

    hold: int
    is_wanted: bool
    is_silent: bool
    reason: str
    remaining: float | None = None


def jog_velocities(robot: Robot) -> dict[str, float]:
    """Return the highest jog velocity of each joint, in rad/s or m/s.

    The lower one of its limit and of the velocity from which it stands ``STOP_S`` after the last
    heartbeat: 0 where the control loop is too slow for that.
    """
    within_s = max(0.0, STOP_S - TIMEOUT_S - LATE_PERIODS / robot.descriptor.cycle.rate_hz)
    found: dict[str, float] = {}
    for group in robot.groups.values():
        limits = group.follower.limits
        stoppable = stoppable_velocity(limits.acceleration, limits.jerk, within_s)
        found |= zip(limits.names, np.minimum(limits.velocity, stoppable).tolist(), strict=True)
    return found


@dataclass(eq=False)
class _Hold:
    """Button that is held.

    Attributes:
        number: of the client.
        stream: of the joint; None until it is open.
        command: called with the stream at each heartbeat.
    """

    number: int
    stream: JointStream | None = None
    command: Command | None = None


class HeldJog:
    """Jog of one client, a joint at a time.

    A hold begins with its first heartbeat and ends by ``release``, by silence for ``timeout_s``,
    or with the stream; later heartbeats of it are ignored, so that nothing moves again before
    the client presses anew. The stream of the control loop is the watchdog: it needs no thread of
    the server. ``beat``, ``release`` and ``close`` never block.

    Args:
        robot: of the joints.
        owner: of the joints while they move.
        workers: open the stream and wait for its end.
        ended: called by a worker with the end of each hold.
        timeout_s: as above, in time of the robot.
    """

    def __init__(
        self,
        robot: Robot,
        owner: str,
        workers: Executor,
        ended: Callable[[JogEnd], None],
        timeout_s: float = TIMEOUT_S,
    ) -> None:
        self.events = robot.events
        self._robot, self._owner, self._workers, self._ended = robot, owner, workers, ended
        self._timeout_s = timeout_s
        self._velocities: Mapping[str, float] = jog_velocities(robot)
        self._newest = 0
        self._hold: _Hold | None = None
        self._lock = threading.Lock()  # of the hold and its stream

    def beat(self, jog: Jog) -> None:
        """Begin a hold, or keep it moving."""
        with self._lock:
            if jog.hold > self._newest:
                self._newest = jog.hold
                self._end(RELEASED)
                self._hold = _Hold(jog.hold)
                self._workers.submit(self._run, self._hold, jog)
                return
            hold = self._hold
            if hold is None or hold.number != jog.hold:
                return
            stream, command = hold.stream, hold.command
        if stream is not None and command is not None:
            try:
                command(stream)
            except NotReady as error:
                stream.end(str(error))  # no effect where it has just ended; the worker says why

    def release(self, number: int, reason: str) -> None:
        """End a hold; the joint slows to rest."""
        with self._lock:
            if self._hold is not None and self._hold.number == number:
                self._end(reason)

    def close(self) -> None:
        """End the hold because its client has gone."""
        with self._lock:
            self._end(CLOSED)

    def _end(self, reason: str) -> None:
        hold, self._hold = self._hold, None
        if hold is not None and hold.stream is not None:
            hold.stream.end(reason)

    def _run(self, hold: _Hold, jog: Jog) -> None:
        """Worker: open the stream, and give the joint back after its end."""
        is_silent, remaining = False, None
        with sent_by(self._owner):
            try:
                stream, command = self.jog(jog.joint, jog.velocity, jog.step)
                with stream:
                    self._begin(hold, stream, command)
                    stream.wait()
                reason, is_silent = stream.message, stream.statistics.timeouts > 0
                remaining = command.remaining if isinstance(command, _Step) else None
            except RobotdError as error:
                reason = str(error)
        with self._lock:
            if self._hold is hold:
                self._hold = None
        is_wanted = reason in (RELEASED, REACHED)
        self._ended(JogEnd(hold.number, is_wanted, is_silent, reason, remaining))

    def _begin(self, hold: _Hold, stream: JointStream, command: Command) -> None:
        """Let the next heartbeat move the joint; a hold that has ended meanwhile never does."""
        with self._lock:
            if self._hold is hold:
                hold.stream, hold.command = stream, command
            else:
                stream.end(RELEASED)

    @noted
    def jog(self, joint: str, velocity: float, step: float | None) -> tuple[JointStream, Command]:
        """Open the stream of one joint. Raises RobotdError with the reason of a rejection."""
        highest = self._velocities.get(joint)
        if highest is None:
            raise InvalidArgument(unknown_name("joint", joint, self._velocities))
        if not highest:
            rate_hz = self._robot.descriptor.cycle.rate_hz
            raise InvalidArgument(
                f"{joint}: no jog by heartbeats at cycle.rate_hz {rate_hz:g}; it takes more than"
                f" {LATE_PERIODS / (STOP_S - TIMEOUT_S):.0f} Hz"
            )
        speed = min(abs(velocity), highest) * (self._robot.axes.speed.scale or 1.0)
        if not speed:
            raise InvalidArgument(f"{joint}: the jog velocity is 0")
        group = self._robot.groups.of([joint])
        command: Command
        if step is None:
            signed = math.copysign(speed, velocity)
            command = partial(JointStream.send_velocity, velocity=[signed])
        else:
            command = _Step(self._robot, group, joint, step)
        stream = group.stream(
            [joint],
            timeout_s=self._timeout_s,
            owner=self._owner,
            ends_when_silent=True,
            max_velocity=[speed],
            source=group.stream.source(self._owner, self._timeout_s),  # each press is a new command
        )
        return stream, command


class _Step:
    """Command of a step: to its target, and the end of the stream there.

    Args:
        robot: of the joint.
        group: of the joint.
        joint: name.
        step: signed distance from the commanded position, rad or m.

    Raises InvalidArgument: the target is beyond a position limit.
    """

    def __init__(self, robot: Robot, group: JointGroup, joint: str, step: float) -> None:
        limits, column = group.follower.limits, group.joint_names.index(joint)
        self._image, self._axis = robot.image, group.joint_axes[column]
        self._target = float(self._image.position_command[self._axis]) + step
        lower, upper, unit = limits.lower[column], limits.upper[column], limits.units[column]
        if not lower <= self._target <= upper:
            limits_text = f"{lower:g} to {upper:g} {unit}"
            raise InvalidArgument(
                f"{joint}: target {self._target:.4f} {unit} is outside {limits_text}"
            )

    @property
    def remaining(self) -> float:
        """Signed distance to the target."""
        return self._target - float(self._image.position_command[self._axis])

    def __call__(self, stream: JointStream) -> None:
        if abs(self.remaining) < REACHED_TOLERANCE:
            stream.end(REACHED)
        else:
            stream.send([self._target])
