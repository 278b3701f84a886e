"""Hold-to-run driving of a mobile base: it moves while heartbeats of a button arrive."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from robotd.api import NotReady, RobotdError, Unsupported
from robotd.api.features import sent_by
from robotd.api.robots import ZERO_TWIST, MobileBase, PlanarTwist, Robot, twist_limits
from robotd_page.control_commands import Finite
from robotd_page.control_jog import LATE_PERIODS
from robotd_page.held_motion import RELEASED, TIMEOUT_S, Heartbeat, JogEnd

MAX_VELOCITY_M_S = 0.25  # reduced speed of manual operation of industrial robots, ISO 10218-1
MAX_ANGULAR_RAD_S = 0.5
LATE = "heartbeats came late"


class DriveBeat(Heartbeat):
    """Heartbeat of a direction of the base that is held.

    Attributes:
        linear, lateral: m/s ahead and to the left.
        angular: rad/s to the left.
    """

    type: Literal["drive"]
    linear: Finite
    lateral: Finite
    angular: Finite


@dataclass(frozen=True)
class DriveLimits:
    """Highest velocities of a base driven from a page, and its stopping distance.

    Attributes:
        linear, lateral: m/s; lateral is 0 where the base cannot move sideways.
        angular: rad/s.
        release_s: from the last heartbeat until it slows down, at most.
        rest_s, rest_m: from the last heartbeat to rest at the highest velocity ahead, at most.
    """

    linear: float
    lateral: float
    angular: float
    release_s: float
    rest_s: float
    rest_m: float


def drive_limits(robot: Robot, timeout_s: float = TIMEOUT_S) -> DriveLimits | None:
    """Return the limits of the robot's base; None without one."""
    if robot.base is None:
        return None
    limits = twist_limits(robot.base.settings)
    linear = min(limits.linear.velocity, MAX_VELOCITY_M_S)
    lateral = min(limits.lateral.velocity, MAX_VELOCITY_M_S) if limits.lateral else 0.0
    angular = min(limits.angular.velocity, MAX_ANGULAR_RAD_S)
    release_s = timeout_s + LATE_PERIODS / robot.descriptor.cycle.rate_hz
    ramp_s = linear / limits.linear.deceleration + limits.smoothing()  # see ``TwistLimiter``
    return DriveLimits(
        linear,
        lateral,
        angular,
        release_s,
        rest_s=release_s + ramp_s,
        rest_m=linear * (release_s + ramp_s / 2.0),
    )


def drive_motions(base: MobileBase, limits: DriveLimits) -> Iterator[Mapping[str, Any]]:
    """Yield name and twist of each button of a page."""
    linear, lateral, angular = limits.linear, limits.lateral, limits.angular
    yield _motion("Forward", linear, 0.0, 0.0)
    yield _motion("Back", -linear, 0.0, 0.0)
    if base.wheels.moves_sideways:
        yield _motion("Left", 0.0, lateral, 0.0)
        yield _motion("Right", 0.0, -lateral, 0.0)
    turn = 0.0 if base.wheels.turns_on_the_spot else linear
    word = "Forward" if turn else "Turn"
    yield _motion(f"{word} left", turn, 0.0, angular)
    yield _motion(f"{word} right", turn, 0.0, -angular)


def _motion(name: str, linear: float, lateral: float, angular: float) -> Mapping[str, Any]:
    return {"name": name, "linear": linear, "lateral": lateral, "angular": angular}


class HeldDrive:
    """Driving of the base by one client. Thread of the server; never blocks.

    A hold begins with its first heartbeat and ends by ``release``, by silence for ``timeout_s``,
    or with a rejection; later heartbeats of it are ignored, so that nothing moves again before
    the client presses anew. Each heartbeat is a command of the base that holds for ``timeout_s``:
    the control loop lets the base slow to rest without any thread of the server.

    Args:
        ended: called with the end of each hold that the client does not end.
        timeout_s: silence that ends a hold, in time of the robot.
    """

    def __init__(
        self,
        robot: Robot,
        sender: str,
        ended: Callable[[JogEnd], None],
        timeout_s: float = TIMEOUT_S,
    ) -> None:
        self._robot, self._sender, self._ended = robot, sender, ended
        self._timeout_s = timeout_s
        self._limits = drive_limits(robot, timeout_s)
        self._newest, self._hold = 0, 0  # 0: none is held
        self._beat_ns = 0

    def beat(self, drive: DriveBeat) -> None:
        """Begin a hold, or keep the base moving."""
        now_ns = self._robot.clock.now_ns()
        if drive.hold > self._newest:
            self._newest = self._hold = drive.hold
        elif drive.hold != self._hold:
            return
        elif now_ns - self._beat_ns > self._timeout_s * 1e9:
            self._end(LATE, is_silent=True)
            return
        self._beat_ns = now_ns
        try:
            self._command(PlanarTwist(drive.linear, drive.angular, drive.lateral), self._timeout_s)
        except RobotdError as error:
            self._end(str(error))

    def release(self, number: int, reason: str) -> None:
        """End a hold, for whatever reason; the base slows to rest."""
        if number == self._hold != 0:
            self.close()

    def close(self) -> None:
        """End the hold because its client has gone."""
        if not self._hold:
            return
        try:
            self._command(ZERO_TWIST)
            self._end(RELEASED)
        except NotReady as error:  # motion is stopped already
            self._end(str(error))

    def _command(self, twist: PlanarTwist, timeout_s: float | None = None) -> None:
        base, limits = self._robot.base, self._limits
        if base is None or limits is None:
            raise Unsupported("a mobile base", self._robot.descriptor.name)
        linear = _clipped(twist.linear, limits.linear)
        lateral = _clipped(twist.lateral, limits.lateral)
        excess = max(math.hypot(linear, lateral) / MAX_VELOCITY_M_S, 1.0)
        with sent_by(self._sender):
            base.command(
                linear / excess,
                _clipped(twist.angular, limits.angular),
                lateral / excess,
                timeout_s,
                source=f"{self._sender}, hold {self._hold}",  # each press is a new command
            )

    def _end(self, reason: str, *, is_silent: bool = False) -> None:
        hold, self._hold = self._hold, 0
        self._ended(JogEnd(hold, reason == RELEASED, is_silent, reason))


def _clipped(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
