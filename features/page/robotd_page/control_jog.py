"""Hold-to-run jog of single joints: a joint moves while heartbeats of its button arrive."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Literal

import numpy as np

from robotd.api import InvalidArgument, unknown_name
from robotd.api.features import ProcessImage, logged_command
from robotd.api.robots import JointGroup, JointStream, Robot, stoppable_velocity
from robotd_page.control_commands import Finite
from robotd_page.held_motion import REACHED, TIMEOUT_S, Heartbeat, HeldMotion, Hold, StreamedMotion

STOP_S = 0.15  # from the last heartbeat to standstill
LATE_PERIODS = 3  # of the control loop, until it sees the silence and the drive has followed
REACHED_TOLERANCE = 1e-6  # rad or m


class JogBeat(Heartbeat):
    """Heartbeat of a button that is held, or of a step that is under way.

    Attributes:
        joint: name.
        velocity: signed, or positive with a step; rad/s or m/s.
        step: signed distance from where the joint is commanded now, rad or m; None: no end.
    """

    type: Literal["jog"]
    joint: str
    velocity: Finite
    step: Finite | None = None


def jog_velocities(robot: Robot) -> dict[str, float]:
    """Return the highest jog velocity of each joint, in rad/s or m/s.

    The lower one of its limit and of the velocity from which it comes to rest within ``STOP_S``
    after the last heartbeat: 0 where the control loop is too slow for that.
    """
    within_s = max(0.0, STOP_S - TIMEOUT_S - LATE_PERIODS / robot.descriptor.cycle.rate_hz)
    found: dict[str, float] = {}
    for group in robot.groups.values():
        limits = group.follower.limits
        stoppable = stoppable_velocity(limits.acceleration, limits.jerk, within_s)
        found |= zip(limits.names, np.minimum(limits.velocity, stoppable).tolist(), strict=True)
    return found


def require_stoppable(robot: Robot, joint: str, velocity: float) -> None:
    """Raise InvalidArgument for a joint whose highest jog velocity is 0."""
    if not velocity:
        raise InvalidArgument(
            f"{joint}: no jog by heartbeats at cycle.rate_hz {robot.descriptor.cycle.rate_hz:g};"
            f" it takes more than {LATE_PERIODS / (STOP_S - TIMEOUT_S):.0f} Hz"
        )


class HeldJoint(HeldMotion[JogBeat]):
    """Jog of one client, a joint at a time."""

    @cached_property
    def _velocities(self) -> Mapping[str, float]:
        return jog_velocities(self._robot)

    def open(self, beat: JogBeat, hold: Hold) -> StreamedMotion:
        return self.jog(beat.joint, beat.velocity, beat.step)

    @logged_command
    def jog(self, joint: str, velocity: float, step: float | None) -> StreamedMotion:
        """Open the stream of one joint. Raises RobotdError with the reason of a rejection."""
        highest = self._velocities.get(joint)
        if highest is None:
            raise InvalidArgument(unknown_name("joint", joint, self._velocities))
        require_stoppable(self._robot, joint, highest)
        speed = min(abs(velocity), highest) * (self._robot.axes.speed.scale or 1.0)
        if not speed:
            raise InvalidArgument(f"{joint}: the jog velocity is 0")
        group = self._robot.groups.of([joint])
        column = group.joint_names.index(joint)
        image, axis = self._robot.image, group.joint_axes[column]
        target = float(image.position_command[axis]) + (step or 0.0)
        if step is not None:
            _check_target(group, column, target)
        stream = group.stream(
            [joint],
            timeout_s=self._timeout_s,
            owner=self._owner,
            ends_when_silent=True,
            max_velocity=[speed],
            source=group.stream.source(self._owner, self._timeout_s),  # each press is a new command
        )
        if step is None:
            return _Velocity(stream, math.copysign(speed, velocity))
        return _Step(stream, image, axis, target)


class _Velocity(StreamedMotion):
    """Motion of a joint until it is released, with a signed velocity in rad/s or m/s."""

    def __init__(self, stream: JointStream, velocity: float) -> None:
        super().__init__(stream)
        self._velocity = velocity

    def beat(self) -> None:
        self.stream.send_velocity([self._velocity])


class _Step(StreamedMotion):
    """Motion to a target, and the end of the stream there.

    Args:
        target: rad or m.
    """

    def __init__(self, stream: JointStream, image: ProcessImage, axis: int, target: float) -> None:
        super().__init__(stream)
        self._image, self._axis, self._target = image, axis, target

    @property
    def remaining(self) -> float:
        return self._target - float(self._image.position_command[self._axis])

    def beat(self) -> None:
        if abs(self.remaining) < REACHED_TOLERANCE:
            self.end(REACHED)
        else:
            self.stream.send([self._target])


def _check_target(group: JointGroup, column: int, target: float) -> None:
    """Raise InvalidArgument for a target beyond a position limit."""
    limits = group.follower.limits
    lower, upper, unit = limits.lower[column], limits.upper[column], limits.units[column]
    if not lower <= target <= upper:
        raise InvalidArgument(
            f"{limits.names[column]}: target {target:.4f} {unit} is outside"
            f" {lower:g} to {upper:g} {unit}"
        )
