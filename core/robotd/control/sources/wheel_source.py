"""Setpoint sources of a mobile base, from the commanded twist and its time-out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.control.loop.rearming import Admission
from robotd.control.loop.setpoint_source import Outcome, SetpointSource
from robotd.control.loop.stall_recovery import StallRecovery
from robotd.device.axes import Axes
from robotd.device.process_image import ProcessImage
from robotd.device.state import STREAMING, CommandMode
from robotd.log import get_logger
from robotd.motion import JointLimits
from robotd.motion.base_kinematics import WheelFollower
from robotd.motion.base_twist_limits import TwistLimiter
from robotd.motion.planar import ZERO_TWIST, PlanarTwist

log = get_logger("base")


@dataclass(frozen=True)
class _Command:
    """Command with the time of its sending and its time-out, ns."""

    twist: PlanarTwist
    sent_ns: int
    timeout_ns: int
    admission: Admission


class TwistCommand:
    """Twist in force until the next one, its time-out, or an interruption of motion.

    ``target`` is for the control loop, the rest for any thread.

    Attributes:
        stopped: no command is in force until this is False again.
    """

    def __init__(self) -> None:
        self.stopped = False
        self._command: _Command | None = None
        self._late = False

    @property
    def ended(self) -> bool:
        """The last ``target`` was standstill because no command was in force."""
        return self._late or self.stopped

    def set(self, twist: PlanarTwist, time_ns: int, timeout_s: float, admission: Admission) -> None:
        """Replace the command by ``twist``, which was sent at ``time_ns``."""
        self._command = _Command(twist, time_ns, round(timeout_s * NANOSECONDS), admission)

    def moves(self, time_ns: int) -> bool:
        """Return True when a command other than standstill is in force at ``time_ns``."""
        command = self._command
        if command is None or self.stopped or time_ns - command.sent_ns > command.timeout_ns:
            return False
        return command.twist != ZERO_TWIST and command.admission.holds

    def target(self, time_ns: int) -> PlanarTwist:
        """Return the twist to reach at ``time_ns``; a time-out in motion is logged."""
        command = self._command
        if self.stopped:
            return ZERO_TWIST
        if command is None or not command.admission.holds:
            self._late = True
            return ZERO_TWIST
        late = time_ns - command.sent_ns > command.timeout_ns
        if late and not self._late and command.twist != ZERO_TWIST:
            timeout_s = command.timeout_ns / NANOSECONDS
            log.warning("no command in time: the base slows to rest", timeout_s=timeout_s)
        self._late = late
        return ZERO_TWIST if late else command.twist


OWNER = "mobile base"


class WheelMotion(SetpointSource):
    """Motion of the wheels from a claim to standstill, within the limits of the base.

    A setpoint that was not sent is repeated in the next period, so that the speed changes by one
    step from the last one that the device has. It is repeated, too, while a drive does not answer,
    which keeps its speed: the base would turn. A stop does not wait for it. Steering axes continue
    after an underrun where the device has led them, as joints do (``StallRecovery``); the base is
    slower until they are on their path again, down to rest where underruns add up.

    Args:
        wheel_axes: axes of the wheels, in the order of ``follower``.
        modes: of these axes; those in position mode steer.
        follower: of the limited twists, at rest; one for each motion.
        limiter: at rest; one for each motion.
        claimed_ns: time of the claim.
        start_ns: due time of the first setpoint, at the earliest.

    Attributes:
        twist: of the base, by the last setpoint.
    """

    def __init__(
        self,
        axes: Axes,
        wheel_axes: tuple[int, ...],
        modes: tuple[CommandMode, ...],
        follower: WheelFollower,
        limiter: TwistLimiter,
        command: TwistCommand,
        claimed_ns: int,
        start_ns: int,
    ) -> None:
        super().__init__(wheel_axes, start_ns, np.zeros((3, len(wheel_axes))))
        self.twist = ZERO_TWIST
        self.setpoint[0] = np.nan
        self._axes, self._wheel_axes, self._modes = axes, wheel_axes, modes
        self._steered = [place for place, mode in enumerate(modes) if mode is CommandMode.POSITION]
        self._follower, self._limiter, self._command = follower, limiter, command
        self._claimed_ns = claimed_ns
        self._sent = True
        if self._steered:
            self._path: FloatArray = np.array([follower.angles, np.zeros(len(self._steered))])
            self._steering_axes = [wheel_axes[place] for place in self._steered]
            self.stall_recovery = StallRecovery(
                self._path,
                start_ns,
                _limits_of(axes, self._steering_axes),
                axes.extrapolation_s,
                axes.stream_buffer_s,
            )

    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> bool:
        """Compute the wheel speeds one step further; False after its end."""
        if self.completion.done:
            return False
        if (loss := self._loss(image)) is not None:
            self._fail(loss)
            return False
        ending = self.completion.requested
        twist = ZERO_TWIST if ending else self._command.target(time_ns)
        twist = twist.scaled(self._axes.speed.scale * self._nearness)
        silent = bool(image.silent[self.columns].any())
        if silent:  # a stop, too, would go on speeding up within the limits of jerk
            self._limiter.speed_up_no_more()
        waits = twist != ZERO_TWIST and silent
        if self._sent and not waits:
            is_at_rest = self._limiter.at_rest and self._follower.at_rest and not self._deviates
            if is_at_rest and (ending or self._command.ended):
                self.completion.finish(*(ending or (Outcome.SUCCEEDED, "at rest")))
                return False
            self._set_wheels(self._limiter.step(twist))
        self._sent = False
        if self.stall_recovery is not None:
            self._recover(self.stall_recovery, time_ns + period_ns, period_ns / NANOSECONDS, image)
        return not self.completion.done

    def sent(self, due_ns: int) -> None:
        self._sent = True
        if self.stall_recovery is not None:
            self.stall_recovery.sent(self.setpoint[:2, self._steered], due_ns)

    def _set_wheels(self, twist: PlanarTwist) -> None:
        """Set the next setpoint of each axis; ``twist`` is within the limits."""
        follower = self._follower
        follower.step(twist)
        self.twist = follower.twist
        velocities = np.array(follower.velocities)
        if self._steered:
            self._path[:] = follower.angles, velocities[self._steered]
        self.setpoint[1] = velocities

    @property
    def _deviates(self) -> bool:
        """A steering axis is off its path, after a stall."""
        return self.stall_recovery is not None and self.stall_recovery.active

    @property
    def _nearness(self) -> float:
        """Share of the speed that is driven: the base leaves its arc while steering is off."""
        return 1.0 if self.stall_recovery is None else self.stall_recovery.nearness

    def _recover(
        self, recovery: StallRecovery, due_ns: int, period_s: float, image: ProcessImage
    ) -> None:
        """Set the setpoints of steering, from where an underrun or a silence has left them."""
        steering = self._path.copy()
        recovery.correct(steering, due_ns, period_s)
        silent = image.silent[self._steering_axes]
        if silent.any():
            recovery.hold(steering, silent, image.position_command[self._steering_axes], period_s)
        if silent.any() and recovery.is_far.any():
            far = int(np.argmax(recovery.is_far))
            name = self._axes.names[self._wheel_axes[self._steered[far]]]
            off = f"{name} is {abs(recovery.offset[far]):.3f} rad off its path"
            self._fail(f"{off} {recovery.cause}")
        self.setpoint[:2, self._steered] = steering

    def _fail(self, reason: str) -> None:
        self.completion.finish(Outcome.FAULT, reason)
        self._axes.stops.request(self._wheel_axes)  # setpoints of others would keep them going

    def _loss(self, image: ProcessImage) -> str | None:
        """Return the reason why the claimed wheels cannot move; None: they can."""
        for axis, mode in zip(self._wheel_axes, self._modes, strict=True):
            if error := self._axes.inability(axis, mode, OWNER):
                return str(error)
            # Values from before the claim cannot show it yet.
            if image.fresh_ns > self._claimed_ns and image.operation.item(axis) != STREAMING:
                return f"{self._axes.names[axis]} was stopped by something else"
        return None


def _limits_of(axes: Axes, chosen: Sequence[int]) -> JointLimits:
    limits = [axes.limits[axis] for axis in chosen]
    return JointLimits(
        tuple(axes.names[axis] for axis in chosen),
        np.array([limit.lower for limit in limits]),
        np.array([limit.upper for limit in limits]),
        np.array([limit.velocity for limit in limits]),
        np.array([limit.acceleration for limit in limits]),
    )
