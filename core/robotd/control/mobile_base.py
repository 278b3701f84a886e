"""Differential-drive base: velocity commands in, wheel commands and odometry out."""

from __future__ import annotations

import math
import threading

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, Clock, wait_until
from robotd.control.setpoint_mixer import SetpointMixer
from robotd.descriptor import DriveSettings
from robotd.device.axes import Axes
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, Operation
from robotd.errors import InvalidArgument, NotReady
from robotd.log import get_logger
from robotd.motion.diff_drive import ZERO_TWIST, Odometry, PlanarTwist, Pose, WheelPair
from robotd.motion.limits import AxisLimits
from robotd.motion.twist_limits import RampLimits, TwistLimiter, TwistLimits

log = get_logger("base")

OWNER = "mobile base"
JUMP = 3.0  # times the wheel speed limit: a larger step means the position was renumbered


class MobileBase:
    """Differential drive that claims its wheels while it is commanded, and its odometry.

    The control loop limits the commanded twist, streams wheel speeds and integrates the odometry,
    once a period. Calls that may block run in the thread ``robotd-base``.

    Between commands, and after a fault, no axis is claimed: the wheels are then ordinary axes.
    While the device is lost the odometry pauses; it continues from a new baseline.

    Attributes:
        settings: of the descriptor, or of the ROS parameters.
        wheels: kinematics of the pair.
    """

    def __init__(
        self, axes: Axes, mixer: SetpointMixer, settings: DriveSettings, clock: Clock
    ) -> None:
        self._axes = axes
        self._clock = clock
        self._period_s = mixer.period_ns / NANOSECONDS
        self._command = (ZERO_TWIST, 0)  # and its time of arrival
        self._late = False
        self._stopped = False
        self._streaming = False
        self._claimed_ns = 0
        self._fresh_ns = 0
        self._rejection: str | None = None
        self._lock = threading.Lock()  # of the odometry
        self._free = threading.Event()
        self._free.set()
        self._wake = threading.Event()
        self._released = threading.Event()
        self._closing = False
        self._thread: threading.Thread | None = None
        self.configure(settings)
        mixer.add(self)

    def configure(self, settings: DriveSettings) -> None:
        """Set the parameters and reset the odometry. Before ``start`` only."""
        self.settings = settings
        self.wheels = WheelPair(settings.wheel_radius_m, settings.wheel_separation_m)
        self._limiter = TwistLimiter(twist_limits(settings), self._period_s)
        self._odometry = Odometry(self.wheels, settings.wheel_wrap_rad)
        self._timeout_ns = round(settings.command_timeout_s * NANOSECONDS)
        self._jump = JUMP * wheel_limits(settings).velocity

    @property
    def pose(self) -> Pose:
        """Pose relative to the start or the last reset. Any thread."""
        return self._odometry.pose

    def twist(self, image: ProcessImage) -> PlanarTwist:
        """Return the measured twist, from the wheel velocities in ``image``."""
        left, right = self.settings.axes
        return self.wheels.twist(float(image.velocity[left]), float(image.velocity[right]))

    def command(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Set the twist until the next command, for ``command_timeout_s`` at most.

        Any thread; never blocks. A twist beyond the limits is scaled down on its arc. Wheels that
        cannot be moved are logged once, and each command tries again.

        Raises:
            InvalidArgument: a number is not finite.
            NotReady: the base was stopped by ``stop``.
        """
        if not (math.isfinite(linear_m_s) and math.isfinite(angular_rad_s)):
            raise InvalidArgument(
                f"twist of {linear_m_s} m/s and {angular_rad_s} rad/s is not finite"
            )
        if self._stopped:
            raise NotReady("the base is being stopped")
        self._command = (PlanarTwist(linear_m_s, angular_rad_s), self._clock.now_ns())
        if not self._streaming:
            self._wake.set()

    def reset_odometry(self) -> None:
        """Make the current pose the origin. Any thread."""
        with self._lock:
            self._odometry.reset()

    def stop(self, timeout_s: float) -> None:
        """Slow to rest, release the wheels, and reject commands until the engine restarts.

        Any thread but the control loop. After ``timeout_s`` it logs an error and returns.
        """
        self._stopped = True
        if not wait_until(self._free.is_set, timeout_s, self._clock):
            log.error("the base is not at rest", after_s=timeout_s)

    def start(self) -> None:
        """Accept commands from now on. A second call has no effect."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._serve, name="robotd-base", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the thread and wait for it. A second call has no effect."""
        self._closing = True
        self._streaming = False
        self._wake.set()
        self._released.set()
        if self._thread is not None:
            self._thread.join()

    def advance(
        self, time_ns: int, image: ProcessImage, position: FloatArray, velocity: FloatArray
    ) -> bool:
        """Run one period; write the wheel velocities. Control-loop thread."""
        self._track(image)
        if not self._streaming:
            return False
        if (reason := self._loss_of_wheels(time_ns, image)) is not None:
            self._log_rejection(reason)
            self._release()
            return False
        left, right = self.settings.axes
        twist = self._limiter.step(self._target(time_ns))
        velocity[left], velocity[right] = self.wheels.speeds(twist)
        if self._limiter.at_rest and (self._late or self._stopped):
            self._release()
        return True

    def device_lost(self, reason: str) -> None:
        """Release the wheels; their positions are unknown now. Control-loop thread."""
        self._stopped = False
        with self._lock:
            self._odometry.rebase()
        if self._streaming:
            self._log_rejection(reason)
            self._release()

    def _track(self, image: ProcessImage) -> None:
        left, right = (float(image.position[axis]) for axis in self.settings.axes)
        elapsed_s = (image.fresh_ns - self._fresh_ns) / NANOSECONDS
        if elapsed_s <= 0.0 or not math.isfinite(left + right):
            return
        self._fresh_ns = image.fresh_ns
        longest_step = self._jump * max(elapsed_s, self._period_s)
        with self._lock:
            moved = self._odometry.update(left, right, longest_step)
        if not moved:
            log.warning("a wheel's position was renumbered; odometry goes on from there")

    def _target(self, time_ns: int) -> PlanarTwist:
        twist, arrival_ns = self._command
        if self._stopped:
            return ZERO_TWIST
        late = time_ns - arrival_ns > self._timeout_ns
        if late and not self._late and twist != ZERO_TWIST:
            seconds = self.settings.command_timeout_s
            log.warning("no command in time: the base slows to rest", timeout_s=seconds)
        self._late = late
        return ZERO_TWIST if late else twist

    def _loss_of_wheels(self, time_ns: int, image: ProcessImage) -> str | None:
        """Return the reason why the claimed wheels cannot move; None: they can."""
        for axis in self.settings.axes:
            if error := self._axes.rejection(axis, CommandMode.VELOCITY, OWNER):
                return str(error)
            # Values from before the claim cannot show it yet.
            if time_ns > self._claimed_ns and image.operation[axis] != Operation.STREAM:
                return f"{self._axes.names[axis]} was stopped by something else"
        return None

    def _release(self) -> None:
        self._streaming = False
        self._limiter.reset()
        self._released.set()

    def _log_rejection(self, rejection: str | None) -> None:
        if rejection == self._rejection:
            return
        self._rejection = rejection
        if rejection is None:
            log.info("the base can move again")
        else:
            log.warning("the base cannot move", reason=rejection)

    def _serve(self) -> None:
        while True:
            self._wake.wait()
            self._wake.clear()
            if self._closing:
                return
            twist, arrival_ns = self._command
            if twist != ZERO_TWIST and self._clock.now_ns() - arrival_ns <= self._timeout_ns:
                self._free.clear()
                self._hold_wheels()
                self._free.set()

    def _hold_wheels(self) -> None:
        """Claim the wheels until the control loop releases them."""
        try:
            with self._axes.claimed(OWNER, self.settings.axes, CommandMode.VELOCITY):
                self._log_rejection(None)
                self._released.clear()
                self._claimed_ns = self._clock.now_ns()
                self._streaming = not self._closing
                if self._streaming:
                    self._released.wait()
        except Exception as error:  # noqa: BLE001 - logged; the next command tries again
            self._log_rejection(str(error))


def twist_limits(settings: DriveSettings) -> TwistLimits:
    """Return the limits of the base as ``TwistLimits``."""
    return TwistLimits(
        RampLimits(
            settings.velocity_m_s,
            settings.acceleration_m_s2,
            settings.deceleration_m_s2,
            settings.jerk_m_s3 or math.inf,
        ),
        RampLimits(
            settings.angular_velocity_rad_s,
            settings.angular_acceleration_rad_s2,
            settings.angular_deceleration_rad_s2,
            settings.angular_jerk_rad_s3 or math.inf,
        ),
        (settings.wheel_velocity_rad_s or math.inf) * settings.wheel_radius_m,
        settings.wheel_separation_m / 2,
    )


def wheel_limits(settings: DriveSettings) -> AxisLimits:
    """Return the limits of a wheel as an axis: its share of the fastest twist."""
    limits = twist_limits(settings)
    ramps = [max(part.acceleration, part.deceleration) for part in (limits.linear, limits.angular)]
    rim = limits.linear.velocity + limits.half_track * limits.angular.velocity
    return AxisLimits(
        -math.inf,
        math.inf,
        min(rim, limits.rim) / settings.wheel_radius_m,
        (ramps[0] + limits.half_track * ramps[1]) / settings.wheel_radius_m,
    )
