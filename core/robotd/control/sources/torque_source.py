"""Setpoint source that applies the torques of a client, within limits of the motion."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.clock import NANOSECONDS
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.joint_source import JointSource, SourcePhase
from robotd.device.axes import Axes
from robotd.device.braking import REACTION_PERIODS
from robotd.device.drivers import AxisDriver
from robotd.device.motion_limits import MotionLimits
from robotd.device.process_image import ProcessImage
from robotd.motion import JointLimits
from robotd.motion.limits import room_to_stop

FADE_SHARE = 0.8  # of a joint's velocity limit, below full speed


class TorqueMotion(JointSource):
    """Torques of m joints, ended by a stop of the drives.

    It has no setpoints of position: the device gets torques, and keeps the one that holds the
    joints until the first command. It ends when no command has come for ``timeout_s``, when a
    client requests it, with a fault, and as soon as a joint exceeds its velocity limit or has just
    enough room left to brake before a position limit. The driver then brings the joints to rest in
    position control.

    The speed of all motion scales the velocity limits. Below full speed a torque that drives a
    joint on fades from ``FADE_SHARE`` of its limit to nothing there; one that brakes it stays.

    Args:
        robot: axes of the robot; the stream ends at a speed of 0, and keeps to others.
        axes: (m,) index of each joint's axis.
        start_ns: monotonic time of its first period, at the earliest.
        timeout_s: age of the last command at which it ends.
        stopped_velocity: (m,) rad/s or m/s below which a joint is at rest.
        motion_limits: of the group; the stream ends under one, as torques keep none.
    """

    def __init__(
        self,
        driver: AxisDriver,
        robot: Axes,
        axes: IntArray,
        limits: JointLimits,
        start_ns: int,
        timeout_s: float,
        stopped_velocity: FloatArray,
        motion_limits: MotionLimits,
    ) -> None:
        setpoint = np.full((3, len(axes)), np.nan)
        super().__init__(limits, axes, start_ns, setpoint, stopped_velocity, robot.response_s)
        self._driver, self._stops, self._speed = driver, robot.stops, robot.speed
        self._timeout_s, self._motion_limits = timeout_s, motion_limits
        self._feedback_period_s = robot.feedback_period_s
        self._command: tuple[int, FloatArray | None] = (start_ns, None)  # replaced as a whole
        self._torque: FloatArray = np.zeros(0)  # of all axes of the device; NaN: unchanged

    def put(self, torque: FloatArray, time_ns: int) -> None:
        """Apply ``torque`` (m,), N·m or N, from the next period on; never blocks. Any thread."""
        self._command = time_ns, torque

    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> bool:
        """Send the torque for this period, or monitor the stop; return False."""
        if self._phase is SourcePhase.RUNNING and not self.completion.done:
            self._check(time_ns, period_ns, image)
            if self.completion.requested is None:
                self._apply(time_ns + period_ns, image)
            else:
                self._enter(SourcePhase.STOPPING, time_ns)
                self._stops.request(self._axes.tolist())
        elif not self.completion.done:
            self._end_at_rest(time_ns, image)
        return False

    def _apply(self, due_ns: int, image: ProcessImage) -> None:
        if not len(self._torque):
            self._torque = np.full(image.axes, np.nan)
        torque, scale = self._command[1], self._speed.scale
        if torque is not None:
            if scale < 1.0:
                torque = self._faded(torque, image.velocity[self._axes], scale)
            self._torque[self._axes] = torque
        self._driver.stream_torque(self._torque, due_ns)

    def _faded(self, torque: FloatArray, velocity: FloatArray, scale: float) -> FloatArray:
        """Return ``torque`` (m,), reduced where it would drive a joint beyond its scaled limit."""
        share = np.abs(velocity) / (scale * self._limits.velocity)
        left = np.clip((1.0 - share) / (1.0 - FADE_SHARE), 0.0, 1.0)
        return np.where(torque * velocity > 0.0, torque * left, torque)

    def _check(self, time_ns: int, period_ns: int, image: ProcessImage) -> None:
        """Request the end where it has to stop."""
        self._check_drives(image, (time_ns - self.start_ns) / NANOSECONDS, period_ns)
        if not self._speed.scale:
            self.completion.request(Outcome.STOPPED, f"motion is {self._speed.text}")
        elif reason := self._motion_limits.reason or self._excess(period_ns, image):
            self.completion.request(Outcome.STOPPED, reason)
        elif time_ns - self._command[0] > self._timeout_s * NANOSECONDS:
            self.completion.request(Outcome.SUCCEEDED, f"no command for {self._timeout_s:g} s")

    def _excess(self, period_ns: int, image: ProcessImage) -> str:
        """Return the limit that a joint exceeds or is about to; "" without one."""
        scale = self._speed.scale
        at = "" if scale == 1.0 else f" at a speed of {self._speed.text}"
        reaction_s = REACTION_PERIODS * period_ns / NANOSECONDS + self._feedback_period_s
        rows = zip(
            self._limits.names,
            self._joints,
            image.position[self._axes].tolist(),
            image.velocity[self._axes].tolist(),
            strict=True,
        )
        for name, limits, position, velocity in rows:
            unit, fastest = limits.unit, scale * limits.velocity
            if not abs(velocity) <= fastest:  # also of a velocity that is not a number
                return (
                    f"{name}: {velocity:.3g} {unit}/s, its velocity limit{at} is"
                    f" {fastest:g} {unit}/s"
                )
            room = room_to_stop(limits, position, velocity, limits.acceleration)
            inside = limits.lower <= position <= limits.upper
            if not (room >= abs(velocity) * reaction_s and inside):
                limit = limits.upper if velocity > 0.0 else limits.lower
                return f"{name}: at {position:.3g} {unit}, too close to its limit {limit:g} {unit}"
        return ""
