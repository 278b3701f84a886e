"""Setpoint source of a steered base: speed of the driven wheel and steering angle."""

from __future__ import annotations

from robotd.clock import NANOSECONDS
from robotd.control.twist_command import TwistCommand
from robotd.control.wheel_motion import WheelMotion
from robotd.device.axes import Axes
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode
from robotd.motion.planar import PlanarTwist
from robotd.motion.steering import SteeringFollower, SteeringLimits
from robotd.motion.tricycle import SteeredWheels
from robotd.motion.twist_limits import TwistLimiter

MODES = (CommandMode.VELOCITY, CommandMode.POSITION)  # of the driven wheel, of the steering


class SteeredMotion(WheelMotion):
    """Motion of a driven wheel in velocity mode and a steering axis in position mode.

    Args:
        limits: of both axes; the others are those of ``WheelMotion``.
    """

    def __init__(
        self,
        axes: Axes,
        wheel_axes: tuple[int, ...],
        wheels: SteeredWheels,
        limits: SteeringLimits,
        limiter: TwistLimiter,
        command: TwistCommand,
        claimed_ns: int,
        start_ns: int,
    ) -> None:
        super().__init__(axes, wheel_axes, wheels, limiter, command, claimed_ns, start_ns)
        self._steered_wheels, self._limits = wheels, limits
        self._follower: SteeringFollower | None = None

    def _mode(self, place: int) -> CommandMode:
        return MODES[place]

    def _turns(self) -> bool:
        return self._follower is not None and not self._follower.at_rest

    def _follow(self, twist: PlanarTwist, period_ns: int, image: ProcessImage) -> None:
        """Set speed and angle of the next setpoint; ``twist`` is within the base's limits."""
        per_s = NANOSECONDS / period_ns
        if self._follower is None:
            angle = float(image.position_command[self._wheel_axes[1]])
            self._follower = SteeringFollower(
                self._steered_wheels, self._limits, angle, 1.0 / per_s
            )
        follower = self._follower
        before = follower.speed, follower.rate
        follower.step(twist)
        self.twist = follower.twist
        now = follower.speed, follower.rate
        self.setpoint[0, 1] = follower.angle
        self.setpoint[1] = now
        self.setpoint[2] = [(new - old) * per_s for new, old in zip(now, before, strict=True)]
