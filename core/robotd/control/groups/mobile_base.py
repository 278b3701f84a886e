"""Mobile base: velocity commands in, wheel commands out; odometry without jumps of positions."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from robotd.clock import NANOSECONDS, Clock, wait_until
from robotd.control.groups.descriptor_limits import base_kinematics, twist_limits, wheel_limits
from robotd.control.groups.streams import chosen_timeout
from robotd.control.loop.rearming import CommandSource, Rearming
from robotd.control.loop.setpoint_mixer import SourceSlot
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.wheel_source import OWNER, TwistCommand, WheelMotion
from robotd.descriptor import DriveSettings
from robotd.device.axes import Axes
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode
from robotd.errors import InvalidArgument, NotReady
from robotd.events import logged_command
from robotd.log import get_logger
from robotd.motion.base_kinematics import RollingFollower, SteeredKinematics, WheelFollower
from robotd.motion.base_twist_limits import TwistLimiter
from robotd.motion.dead_reckoning import Odometry
from robotd.motion.planar import ORIGIN, ZERO_TWIST, PlanarTwist, Pose

log = get_logger("base")

NEUTRAL = "a zero twist"
JUMP_SPEED_FACTOR = 3.0  # of the wheel speed limit: a larger step is a jump of the position
LATE_S = 0.1  # positions may be older than their time stamp: then they catch up in one step


class MobileBase:
    """Wheeled base that claims its wheels while it is commanded, and its odometry.

    The control loop limits the commanded twist, streams wheel speeds and steering angles
    (``WheelMotion``) and integrates the odometry (``track``), once a period. The thread
    ``robotd-base`` claims the wheels.

    Between commands, and after a fault, no axis is claimed: the wheels are then ordinary axes.
    While the device is lost the odometry pauses; it continues from a new baseline.

    Attributes:
        events: of the robot, where commands are recorded.
        settings: of the descriptor, or of the ROS parameters.
        wheels: kinematics of the base.
    """

    def __init__(
        self, axes: Axes, slot: SourceSlot, settings: DriveSettings, rearming: Rearming
    ) -> None:
        self._axes, self._slot, self._clock, self._rearming = axes, slot, axes.clock, rearming
        self.events = axes.events
        self._period_s = slot.period_ns / NANOSECONDS
        self._odometry_lock = threading.Lock()
        self._rejection: str | None = None
        self._motion: WheelMotion | None = None
        self._worker = BaseWorker(lambda: self._command.moves(self._clock.now_ns()), self._move)
        self.configure(settings)

    def configure(self, settings: DriveSettings) -> None:
        """Set the parameters and reset the odometry. Before ``start`` only."""
        self.settings = settings
        self.wheels = base_kinematics(settings)
        self._wheel_axes = settings.axes
        self._modes = tuple(
            CommandMode.POSITION if axis in settings.steering_axes else CommandMode.VELOCITY
            for axis in settings.axes
        )
        self._command = TwistCommand()
        self._odometry = Odometry(self.wheels, settings.wheel_wrap_rad)
        self._limits, wheel = twist_limits(settings), wheel_limits(settings)
        self._wheel_acceleration = wheel.acceleration
        self._jump = JUMP_SPEED_FACTOR * wheel.velocity
        self._tracked_ns = 0

    @property
    def pose(self) -> Pose:
        """Pose relative to the start or the last reset. Any thread."""
        return self._odometry.pose

    @property
    def moving(self) -> bool:
        """The wheels are claimed and get setpoints. Any thread."""
        return bool(self._slot.active)

    @property
    def limited(self) -> PlanarTwist:
        """Twist that the wheels are commanded to, within the limits; zero at rest. Any thread."""
        motion = self._motion
        return ZERO_TWIST if motion is None or motion.completion.done else motion.twist

    def twist(self, image: ProcessImage) -> PlanarTwist:
        """Return the measured twist, from the wheel velocities in ``image``."""
        steering = self.settings.steering_axes
        return self.wheels.twist(
            *(
                float(image.position[axis] if axis in steering else image.velocity[axis])
                for axis in self.settings.axes
            )
        )

    @logged_command
    def command(
        self,
        linear_m_s: float,
        angular_rad_s: float,
        lateral_m_s: float = 0.0,
        timeout_s: float | None = None,
        *,
        sent_ns: int | None = None,
        source: str = OWNER,
    ) -> None:
        """Set the twist until the next command, for ``timeout_s`` at most.

        Any thread; never blocks. A twist beyond the limits is scaled down on its arc. Wheels that
        are in use are logged once, and each command tries again.

        Args:
            linear_m_s, angular_rad_s, lateral_m_s: ahead, turning to the left, to the left.
            timeout_s: None: ``command_timeout_s`` of the settings.
            sent_ns: time of the command on the robot's clock, from which its age counts; None, or
                a time to come: now.
            source: name of the client.

        Raises:
            InvalidArgument: a number is not finite, the time-out is not positive, or the base
                cannot move sideways or turn on the spot.
            NotReady: the base was stopped by ``stop``, motion is stopped, a wheel cannot move, or
                the client went on commanding through that and has to begin anew.
        """
        twist = PlanarTwist(linear_m_s, angular_rad_s, lateral_m_s)
        if not all(map(math.isfinite, twist)):
            raise InvalidArgument(
                f"twist of {linear_m_s} m/s ahead, {lateral_m_s} m/s to the left and"
                f" {angular_rad_s} rad/s is not finite"
            )
        seconds = chosen_timeout(timeout_s, self.settings.command_timeout_s)
        if lateral_m_s and not self.wheels.moves_sideways:
            raise InvalidArgument(f"{lateral_m_s} m/s to the left: the base cannot move sideways")
        if angular_rad_s and not (linear_m_s or self.wheels.turns_on_the_spot):
            raise InvalidArgument(
                f"{angular_rad_s} rad/s at 0 m/s: the base cannot turn on the spot"
            )
        admission = self._source(source, seconds).admit(moves=twist != ZERO_TWIST)
        if self._command.stopped:
            raise NotReady("the base is being stopped")
        self._axes.stop_latch.check()
        now_ns = self._clock.now_ns()
        time_ns = now_ns if sent_ns is None else min(sent_ns, now_ns)
        self._command.set(twist, time_ns, seconds, admission)
        # Also while it moves: the motion may be at its end, and would not see this command.
        self._worker.wake()

    def reset_odometry(self, pose: Pose = ORIGIN) -> None:
        """Make ``pose`` the current one. Any thread. Raises InvalidArgument: it is not finite."""
        if not all(map(math.isfinite, pose)):
            raise InvalidArgument(f"pose {tuple(pose)} is not finite")
        with self._odometry_lock:
            self._odometry.reset(pose)

    def stop(self, timeout_s: float) -> None:
        """Slow to rest, release the wheels, and reject commands until ``allow``.

        Any thread but the control loop. After ``timeout_s`` it logs an error and returns.
        """
        self._command.stopped = True
        if not self._worker.wait_idle(timeout_s, self._clock):
            log.error("the base is not at rest", after_s=timeout_s)

    def allow(self) -> None:
        """Accept commands again after ``stop``, of clients that begin anew. Any thread."""
        if self._command.stopped:
            self._rearming.interruptions.add(self._wheel_axes, "the base was stopped")
            self._command.stopped = False

    def start(self) -> None:
        """Accept commands from now on. A second call has no effect."""
        self._worker.start()

    def close(self) -> None:
        """End the thread and wait for it. A second call has no effect."""
        self._worker.closing = True
        self._end_motion()
        self._worker.close()

    def track(self, image: ProcessImage) -> None:
        """Update the odometry, once a period. Control-loop thread."""
        positions = [float(image.position[axis]) for axis in self._wheel_axes]
        elapsed_s = (image.fresh_ns - self._tracked_ns) / NANOSECONDS
        if elapsed_s <= 0.0 or not math.isfinite(sum(positions)):
            return
        self._tracked_ns = image.fresh_ns
        speed = max(abs(float(image.velocity[axis])) for axis in self._wheel_axes)
        late = LATE_S * speed if math.isfinite(speed) else 0.0
        longest_step = self._jump * max(elapsed_s, self._period_s) + late
        with self._odometry_lock:
            moved = self._odometry.update(positions, longest_step)
        if not moved:
            log.warning("a wheel's position has jumped; odometry goes on from there")

    def on_ready(self, ready: bool) -> None:
        """Accept commands, and continue from new wheel positions, when the engine is ready."""
        if ready:
            self.allow()
            with self._odometry_lock:
                self._odometry.rebase()

    def _source(self, name: str, timeout_s: float) -> CommandSource:
        """Return the source of a client's commands."""
        settings = self.settings
        source = CommandSource(
            self._rearming,
            name,
            settings.axes,
            self._modes,
            timeout_s=max(timeout_s, settings.command_timeout_s),
            neutral=NEUTRAL,
            follows_speed=True,
        )
        return self._rearming.find(source)

    def _move(self) -> None:
        """Claim the wheels until the motion has ended. Thread of the base."""
        try:
            with self._claimed():
                self._log_rejection(None)
                motion = self._submit(self._clock.now_ns())
                if self._worker.closing:
                    self._end_motion()
                motion.completion.event.wait()
                self._slot.release()
                if motion.completion.outcome is Outcome.FAULT:
                    self._log_rejection(motion.completion.message)
        except Exception as error:  # noqa: BLE001 - logged; the next command tries again
            self._log_rejection(str(error))

    @contextmanager
    def _claimed(self) -> Iterator[None]:
        """Claim the wheels in velocity mode, and what steers in position mode."""
        steering = self.settings.steering_axes
        wheels = [axis for axis in self.settings.axes if axis not in steering]
        with ExitStack() as claims:
            claims.enter_context(self._axes.claimed(OWNER, wheels, CommandMode.VELOCITY))
            if steering:
                claims.enter_context(self._axes.claimed(OWNER, steering, CommandMode.POSITION))
            yield

    def _submit(self, claimed_ns: int) -> WheelMotion:
        axes = self.settings.axes
        limiter = TwistLimiter(self._limits, self._period_s)
        while True:
            motion = WheelMotion(
                self._axes,
                axes,
                self._modes,
                self._follower(),
                limiter,
                self._command,
                claimed_ns,
                self._slot.next_start_ns,
            )
            self._rearming.interruptions.watch(motion.completion, axes)
            if self._slot.submit(motion, None):
                self._motion = motion
                return motion

    def _follower(self) -> WheelFollower:
        """Return the follower of a motion that begins at the present angles of steering."""
        wheels, axes = self.wheels, self.settings.axes
        if not isinstance(wheels, SteeredKinematics):
            return RollingFollower(wheels)
        angles = self._axes.known_commands([axes[place] for place in wheels.steered]).tolist()
        return wheels.follower(angles, self._wheel_acceleration, self._period_s)

    def _end_motion(self) -> None:
        for motion in self._slot.active:
            motion.completion.finish(Outcome.CANCELED, "the robot is being shut down")

    def _log_rejection(self, rejection: str | None) -> None:
        if rejection == self._rejection:
            return
        self._rejection = rejection
        if rejection is None:
            log.info("the base can move again")
        else:
            log.warning("the base cannot move", reason=rejection)


class BaseWorker:
    """Thread ``robotd-base``: runs ``move`` when a command wakes it. Any thread may call.

    Args:
        is_wanted: returns True while a command asks for motion.
        move: blocks until the motion has ended; must not raise.

    Attributes:
        closing: ``close`` was called.
    """

    def __init__(self, is_wanted: Callable[[], bool], move: Callable[[], None]) -> None:
        self.closing = False
        self._is_wanted, self._move = is_wanted, move
        self._wake = threading.Event()
        self._idle = threading.Event()
        self._idle.set()
        self._thread: threading.Thread | None = None

    @property
    def settled(self) -> bool:
        """True while no motion runs and none is requested."""
        return not self._wake.is_set() and self._idle.is_set()  # in the reverse order of `_run`

    def start(self) -> None:
        """Start the thread. A second call has no effect."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="robotd-base", daemon=True)
            self._thread.start()

    def wake(self) -> None:
        """Check whether motion is wanted; never blocks."""
        self._wake.set()

    def wait_idle(self, timeout_s: float, clock: Clock) -> bool:
        """Block until no motion runs; return False after ``timeout_s``."""
        return wait_until(self._idle.is_set, timeout_s, clock)

    def close(self) -> None:
        """End the thread after the motion, and wait; a second call has no effect."""
        self.closing = True
        self._wake.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        while True:
            self._wake.wait()
            self._idle.clear()
            self._wake.clear()
            if self.closing:
                break
            if self._is_wanted():
                self._move()
            self._idle.set()
        self._idle.set()
