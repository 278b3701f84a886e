"""A mobile base: twists from anybody, wheel speeds to the device, and where it has gone."""

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
JUMP = 3.0  # times the highest wheel speed: no wheel turns that far, its position was renumbered


class MobileBase:
    """Claims the wheels when a command comes and gives them back when the base has stopped.

    The cycle limits the commanded twist, streams wheel speeds and integrates the odometry, once
    a period. What may block belongs to a thread of its own, ``robotd-base``.

    Between commands, and after a fault, nothing is held: the wheels are then ordinary axes.
    Whenever the device is lost, the odometry pauses and goes on from a new baseline.

    Attributes:
        settings, wheels: what the base is.
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
        self._let_go = threading.Event()
        self._closing = False
        self._thread: threading.Thread | None = None
        self.configure(settings)
        mixer.add(self)

    def configure(self, settings: DriveSettings) -> None:
        """Take other settings and begin the odometry anew. Before ``start`` only."""
        self.settings = settings
        self.wheels = WheelPair(settings.wheel_radius_m, settings.wheel_separation_m)
        self._limiter = TwistLimiter(twist_limits(settings), self._period_s)
        self._odometry = Odometry(self.wheels, settings.wheel_wrap_rad)
        self._timeout_ns = round(settings.command_timeout_s * NANOSECONDS)
        self._jump = JUMP * wheel_limits(settings).velocity

    @property
    def pose(self) -> Pose:
        """Where the base is, seen from where it was at the start or the last reset. Any thread."""
        return self._odometry.pose

    @property
    def streaming(self) -> bool:
        """The base moves the wheels now, or holds them. Any thread."""
        return self._streaming

    def twist(self, image: ProcessImage) -> PlanarTwist:
        """The measured twist, by the wheels' velocities in ``image``."""
        left, right = self.settings.axes
        return self.wheels.twist(float(image.velocity[left]), float(image.velocity[right]))

    def command(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Move like this until the next command, for ``command_timeout_s`` at most.

        Any thread; never blocks. Too much is reduced on the commanded arc. Wheels that cannot
        be moved are said once in the log, and tried again with each command.

        Raises:
            InvalidArgument: a number is not finite.
            NotReady: the base is being stopped for good.
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
        """The present pose becomes the origin. Any thread."""
        with self._lock:
            self._odometry.reset()

    def stop(self, timeout_s: float) -> None:
        """Slow to rest, give the wheels back, and refuse commands until the engine restarts.

        Any thread but the cycle's. What takes longer than ``timeout_s`` is left to others.
        """
        self._stopped = True
        if not wait_until(self._free.is_set, timeout_s, self._clock):
            log.error("the base is not at rest", after_s=timeout_s)

    def start(self) -> None:
        """Take commands from now on. Twice is not an error."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._serve, name="robotd-base", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Take no command any more; returns when the thread is gone. Twice is not an error."""
        self._closing = True
        self._streaming = False
        self._wake.set()
        self._let_go.set()
        if self._thread is not None:
            self._thread.join()

    def advance(
        self, time_ns: int, image: ProcessImage, position: FloatArray, velocity: FloatArray
    ) -> bool:
        """Cycle: one period; writes the wheels' velocities."""
        self._track(image)
        if not self._streaming:
            return False
        if (reason := self._reason(time_ns, image)) is not None:
            self._tell(reason)
            self._release()
            return False
        left, right = self.settings.axes
        twist = self._limiter.step(self._target(time_ns))
        velocity[left], velocity[right] = self.wheels.speeds(twist)
        if self._limiter.at_rest and (self._late or self._stopped):
            self._release()
        return True

    def device_lost(self, reason: str) -> None:
        """Cycle: nothing can be moved, and where the wheels are is not known."""
        self._stopped = False
        with self._lock:
            self._odometry.rebase()
        if self._streaming:
            self._tell(reason)
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

    def _reason(self, time_ns: int, image: ProcessImage) -> str | None:
        """Why the wheels, which are claimed, cannot be moved any more."""
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
        self._let_go.set()

    def _tell(self, rejection: str | None) -> None:
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
        """Claim the wheels and let the cycle move them until it lets go."""
        try:
            with self._axes.claimed(OWNER, self.settings.axes, CommandMode.VELOCITY):
                self._tell(None)
                self._let_go.clear()
                self._claimed_ns = self._clock.now_ns()
                self._streaming = not self._closing
                if self._streaming:
                    self._let_go.wait()
        except Exception as error:  # noqa: BLE001 - whatever it is, the next command tries again
            self._tell(str(error))


def twist_limits(settings: DriveSettings) -> TwistLimits:
    """The limits of the base, in the form of ``motion``."""
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
    """What a wheel may be asked for as a single axis: its part of the fastest twist."""
    limits = twist_limits(settings)
    ramps = [max(part.acceleration, part.deceleration) for part in (limits.linear, limits.angular)]
    rim = limits.linear.velocity + limits.half_track * limits.angular.velocity
    return AxisLimits(
        -math.inf,
        math.inf,
        min(rim, limits.rim) / settings.wheel_radius_m,
        (ramps[0] + limits.half_track * ramps[1]) / settings.wheel_radius_m,
    )
