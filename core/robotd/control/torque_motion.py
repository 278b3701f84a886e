"""Setpoint source that applies the torques of a stream, within limits of the motion."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.clock import NANOSECONDS
from robotd.control.completion import Outcome
from robotd.control.joint_source import JointSource, Phase
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.soft_limits import REACTION_PERIODS
from robotd.device.speed_scale import SpeedScale
from robotd.device.stops import StopRequests
from robotd.motion import JointLimits
from robotd.motion.limits import room_to_stop


class TorqueMotion(JointSource):
    """Torques of m joints, ended by a stop of the drives.

    It has no setpoints of position: the device gets torques, and keeps the one that holds the
    joints until the first command. It ends when no command has come for ``timeout_s``, when a
    client requests it, with a fault, and as soon as a joint exceeds its velocity limit or has just
    enough room left to brake before a position limit. The driver then brings the joints to rest in
    position control.

    Args:
        driver: applies the torques.
        stops: end them.
        axes: (m,) index of each joint's axis.
        limits: of the same joints.
        start_ns: monotonic time of its first period, at the earliest.
        timeout_s: age of the last command at which it ends.
        stopped_velocity: (m,) rad/s or m/s below which a joint is at rest.
        speed: of the operator; it ends at 0.
        feedback_period_s: as of ``AxisDriver``.
    """

    def __init__(
        self,
        driver: AxisDriver,
        stops: StopRequests,
        axes: IntArray,
        limits: JointLimits,
        start_ns: int,
        timeout_s: float,
        stopped_velocity: FloatArray,
        speed: SpeedScale,
        feedback_period_s: float,
    ) -> None:
        setpoint = np.full((3, len(axes)), np.nan)
        super().__init__(limits, axes, start_ns, setpoint, stopped_velocity)
        self._driver, self._stops = driver, stops
        self._limits_of_joints = limits.per_joint()
        self._timeout_s, self._speed = timeout_s, speed
        self._feedback_period_s = feedback_period_s
        self._command: tuple[int, FloatArray | None] = (start_ns, None)  # replaced as a whole
        self._torque: FloatArray = np.zeros(0)  # of all axes of the device; NaN: unchanged

    def put(self, torque: FloatArray, time_ns: int) -> None:
        """Apply ``torque`` (m,), N·m or N, from the next period on; never blocks. Any thread."""
        self._command = time_ns, torque

    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> bool:
        """Send the torque for this period, or monitor the stop; return False."""
        if self._phase is Phase.RUNNING and not self.completion.done:
            self._check(time_ns, period_ns, image)
            if self.completion.requested is None:
                self._apply(time_ns + period_ns, image.axes)
            else:
                self._enter(Phase.STOPPING, time_ns)
                self._stops.request(self._axes.tolist())
        elif not self.completion.done:
            self._end_at_rest(time_ns, image)
        return False

    def _apply(self, due_ns: int, axes: int) -> None:
        if not len(self._torque):
            self._torque = np.full(axes, np.nan)
        torque = self._command[1]
        if torque is not None:
            self._torque[self._axes] = torque
        self._driver.stream_torque(self._torque, due_ns)

    def _check(self, time_ns: int, period_ns: int, image: ProcessImage) -> None:
        """Request the end where it has to stop."""
        self._check_drives(image, (time_ns - self.start_ns) / NANOSECONDS, period_ns)
        if not self._speed.scale:
            self.completion.request(Outcome.STOPPED, f"motion is {self._speed.text}")
        elif reason := self._excess(period_ns, image):
            self.completion.request(Outcome.STOPPED, reason)
        elif time_ns - self._command[0] > self._timeout_s * NANOSECONDS:
            self.completion.request(Outcome.SUCCEEDED, f"no command for {self._timeout_s:g} s")

    def _excess(self, period_ns: int, image: ProcessImage) -> str:
        """Return the limit that a joint exceeds or is about to; "" without one."""
        reaction_s = REACTION_PERIODS * period_ns / NANOSECONDS + self._feedback_period_s
        rows = zip(
            self._limits.names,
            self._limits_of_joints,
            image.position[self._axes].tolist(),
            image.velocity[self._axes].tolist(),
            strict=True,
        )
        for name, limits, position, velocity in rows:
            unit, fastest = limits.unit, limits.velocity
            if not abs(velocity) <= fastest:  # also of a velocity that is not a number
                return (
                    f"{name}: {velocity:.3g} {unit}/s, its velocity limit is {fastest:g} {unit}/s"
                )
            room = room_to_stop(limits, position, velocity, limits.acceleration)
            inside = limits.lower <= position <= limits.upper
            if not (room >= abs(velocity) * reaction_s and inside):
                limit = limits.upper if velocity > 0.0 else limits.lower
                return f"{name}: at {position:.3g} {unit}, too close to its limit {limit:g} {unit}"
        return ""
