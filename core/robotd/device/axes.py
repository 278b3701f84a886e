"""Commands of single axes, with all checks of arguments and states, for all backends."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import TypeVar

from robotd.arrays import FloatArray
from robotd.clock import Clock, wait_until
from robotd.device.axis_stops import AxisStops
from robotd.device.braking import Braking
from robotd.device.capabilities import Capability
from robotd.device.connection import Connection
from robotd.device.drivers import AxisDriver
from robotd.device.image_waits import ImageWaits
from robotd.device.motion_limits import MotionLimits
from robotd.device.named_axes import NamedAxes
from robotd.device.process_image import ProcessImage
from robotd.device.servo_switch import ServoSwitch, switch_off
from robotd.device.speed_scale import SpeedScale
from robotd.device.state import (
    COMMUNICATES,
    EXTRAPOLATION_PERIODS,
    GUIDING,
    CommandMode,
    Operation,
    Underrun,
)
from robotd.device.stop_latch import StopLatch
from robotd.errors import DeviceTimeout, NotReady, RobotdError, Unsupported
from robotd.events import EventKind, EventLog, logged_command
from robotd.log import get_logger
from robotd.motion.limits import AxisLimits, check_jog, check_move
from robotd.motion.profile import Profile

log = get_logger("axes")

HAND_GUIDING = "hand guiding"  # owner of the axes that a person moves


def each(axes: Sequence[int], command: Callable[[int], None]) -> Mapping[int, Exception | None]:
    """Run a one-axis command on every axis; return error or None of each."""
    results: dict[int, Exception | None] = {}
    for axis in axes:
        try:
            command(axis)
            results[axis] = None
        except Exception as error:  # noqa: BLE001 - the caller reports every axis
            results[axis] = error
    return results


@dataclass(frozen=True)
class Move:
    """One axis' part of a position command: target in rad or m, absolute or relative."""

    axis: int
    target: float
    profile: Profile


@dataclass(frozen=True)
class Jog:
    """One axis' part of a velocity command; ``profile.velocity`` is signed."""

    axis: int
    profile: Profile


Command = TypeVar("Command", Move, Jog)


class Axes(NamedAxes):
    """The axes of a robot; worker threads only (the control loop calls the driver itself).

    A command on several axes is checked whole before any axis starts. Commands are rejected,
    with the reason, while the engine is not ready, and on an axis that has another owner.

    Checks go by the process image, which is a period behind the device. So a command returns
    when the image shows what it did, and what needs an idle axis looks at an image that is newer
    than the last motion command or stream. An image is as new as its values.

    A driver may take its time to begin a motion, and no stop waits for it: stops are counted, and
    what was stopped meanwhile is stopped again when the driver has begun it. To take away energy or
    speed needs no precondition: servo off and stops reach the driver in any state of the device.

    Args:
        limits: per axis, in force: those of the device are included.
        names: per axis, see ``NamedAxes``.
        period_s: control period, s.
        events: where commands are recorded; None: in its own log.

    Attributes:
        image, connection, clock: of the robot; ``clock`` is to wait by.
        backend: name, for errors.
        stop_latch: no motion starts while it is engaged.
        stops: stops of axes that are not confirmed to be at rest.
        device_limits, feedback_period_s, response_s, stream_buffer_s: of the driver when made.
        extrapolation_s: time by which a streaming axis continues without setpoints, s; 0: it holds.
        speed: of all motion.
        motion_limits: of the joint groups.
        braking: decelerations of moves and velocity commands.
        given_up: axes whose last command was not answered in time; its motion may begin later.
    """

    def __init__(
        self,
        driver: AxisDriver,
        image: ProcessImage,
        connection: Connection,
        limits: Sequence[AxisLimits],
        names: Sequence[str],
        capabilities: frozenset[Capability],
        backend: str,
        clock: Clock,
        period_s: float,
        events: EventLog | None = None,
    ) -> None:
        self.events = events or EventLog(clock.now_ns)
        self.image, self.connection, self.clock, self.backend = image, connection, clock, backend
        self.limits, self.device_limits = tuple(limits), tuple(driver.device_limits)
        self.feedback_period_s, self.response_s = driver.feedback_period_s, driver.response_s
        self.stream_buffer_s = driver.stream_buffer_s
        extrapolates = driver.underrun is Underrun.EXTRAPOLATE
        self.extrapolation_s = EXTRAPOLATION_PERIODS * period_s if extrapolates else 0.0
        super().__init__(names)
        self.stop_latch = StopLatch(driver.read_only, self._note_repeated_stop)
        self.speed = SpeedScale()
        self.speed.on_change(self._note_speed)
        self.motion_limits: list[MotionLimits] = []
        self.braking = Braking(self.limits, image, period_s, self.feedback_period_s)
        self.given_up: set[int] = set()
        self._driver = driver
        self._capabilities = capabilities
        self._waits = ImageWaits(image, connection, clock, self.feedback_period_s)
        self.stops = AxisStops(
            driver,
            image,
            lambda: connection.state in COMMUNICATES,
            names,
            clock,
            self._waits.shown_s,
            connection.settings.shutdown_s,
        )
        self._commanded_ns = 0  # time of the last motion command, or end of a stream
        self._switch = ServoSwitch(self, driver, self._waits)
        self._owners: dict[int, str] = {}  # of the axes that are claimed
        self._lock = threading.RLock()

    def _note_speed(self, scale: float) -> None:
        self.events.add(EventKind.STATE, "speed", f"speed of all motion: {self.speed.text}")

    def _note_repeated_stop(self, reason: str) -> None:
        text, data = f"motion stopped again: {reason}", {"outcome": "repeated"}
        self.events.add(EventKind.STOP, "stop", text, data=data)

    @property
    def trajectories_on_device(self) -> bool:
        """True where the device interpolates trajectories itself, see ``AxisDriver.follow``."""
        able = Capability.TRAJECTORIES_ON_DEVICE in self._capabilities
        return able and self._driver.follows_trajectories

    def wait_for_servos(self) -> bool:
        """Wait for a servo that is being switched on, and until the image shows it.

        Returns False where no such image comes, as in a control-loop stall.
        """
        with self.connection.scaling_lock:
            switched_ns = self.clock.now_ns()
        self._waits.for_newer(switched_ns)
        return self._waits.is_newer(switched_ns)

    def servo_group(self, axis: int) -> tuple[int, ...]:
        """Return the axes that share the servo switch of ``axis``, itself included."""
        groups = (tuple(group) for group in self._driver.servo_groups)
        return next((group for group in groups if axis in group), (axis,))

    def owner(self, axis: int) -> str:
        """Return the owner of ``axis``, also of one guided by hand; "" without one. Any thread."""
        if not 0 <= axis < len(self):  # commands ask before they check their axes
            return ""
        owner = self._owners.get(axis, "")
        return owner or (HAND_GUIDING if self.image.operation.item(axis) == GUIDING else "")

    def check_axes(self, axes: Sequence[int]) -> None:
        """Raise NotReady before the device is ready, InvalidArgument for a wrong axis.

        OperationError where axes are read-only. Part of every command. Any thread.
        """
        self.stop_latch.check_commandable()
        self.connection.require_ready()
        self.check_numbers(axes)

    @logged_command
    def servo(self, axis: int, on: bool, *, offs: Sequence[int] | None = None) -> None:
        """Enable (at the measured position, without a jump) or disable one servo; waits for it.

        Axes that share the servo switch are switched, and checked, with it. Disabling needs no
        precondition but an open device: a stream to the axis is stopped, and where no fresh values
        confirm it NotReady says so. Enabling is rejected while the axis has an owner, because
        setpoints from before would be far away, and after a request to end. A servo that does not
        enable in time is disabled.

        Args:
            axis: its number.
            on: enable.
            offs: ``servo_offs`` when it was asked for: a request to enable that had to wait is
                rejected when the servo was switched off meanwhile. None: asked for now.
        """
        if on:
            self._switch.enable(axis, offs)
        else:
            self._switch.disable(axis)

    @property
    def servo_offs(self) -> Sequence[int]:
        """Number of times that each servo was switched off. Any thread."""
        return self._switch.offs

    def servos_off(self, axes: Sequence[int]) -> Mapping[int, Exception | None]:
        """Switch servos off at the same time, as ``servo``; return error or None of each."""
        return switch_off(self, axes)

    @logged_command
    def clear_alarm(self, axis: int) -> None:
        """Clear the amplifier alarm of one axis; waits until it is gone."""
        self.check_unclaimed(axis)
        with self.naming(axis):
            self._driver.clear_alarm(axis, self.connection.settings.servo_timeout_s)
        self._waits.until(lambda: not self.image.amp_alarm[axis])

    @logged_command
    def set_command_mode(self, axis: int, mode: int) -> None:
        """Set position (0), velocity (1) or torque (2) mode of an idle axis."""
        self.check_unclaimed(axis)
        self.check_command_mode(axis, mode)
        needs = {
            CommandMode.VELOCITY: Capability.VELOCITY_MODE,
            CommandMode.TORQUE: Capability.TORQUE_MODE,
        }.get(CommandMode(mode))
        self._require(needs, f"{CommandMode(mode).name.lower()} mode")
        with self._reserved(axis, "the command mode"), self.naming(axis):
            self._driver.set_command_mode(axis, CommandMode(mode))
            self._waits.until(lambda: bool(self.image.mode[axis] == mode))

    @logged_command
    def set_polarity(self, axis: int, polarity: int) -> None:
        """Set polarity 1 or -1, with the servo off."""
        self.check_unclaimed(axis)
        self.check_polarity(axis, polarity)
        self._require(Capability.SCALING, "polarity")
        with self.connection.scaling_lock, self.naming(axis):
            self._check_servo_off(axis, "polarity")
            self._driver.set_polarity(axis, polarity)
        self._waits.for_newer(self.clock.now_ns())

    @logged_command
    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        """Set encoder counts per unit, a fraction of positive parts, with the servo off."""
        self.check_unclaimed(axis)
        self.check_gear_ratio(axis, numerator, denominator)
        self._require(Capability.SCALING, "gear ratio")
        with self.connection.scaling_lock, self.naming(axis):
            self._check_servo_off(axis, "the gear ratio")
            self._driver.set_gear_ratio(axis, numerator, denominator)
        self._waits.for_newer(self.clock.now_ns())

    @logged_command
    def home(self, axis: int) -> None:
        """Make the present position of one idle axis its home position, or search for it.

        A homing that moves takes the speed in force at its start, and is rejected while that is 0.
        """
        self.check_unclaimed(axis)
        self.stop_latch.check()
        self._require(Capability.HOMING, "homing")
        timeout_s = self.connection.settings.homing_timeout_s
        with self._reserved(axis, "homing"), self.naming(axis):
            max_speed = self._homing_speed(axis)
            self.given_up.discard(axis)
            try:
                if max_speed:
                    self._driver.search_home(axis, max_speed, timeout_s)
                else:
                    self._driver.home(axis, timeout_s)
            except DeviceTimeout:
                self.given_up.add(axis)
                raise
            self._waits.for_newer(self.clock.now_ns())

    @logged_command
    def move(self, moves: Sequence[Move], *, relative: bool = False) -> None:
        """Start position moves together. Returns when all are accepted, not when they end.

        A relative target counts from the position command. What is stopped meanwhile is not begun.
        A deceleration that is too gentle to stop within the limits is not taken (``Braking``).
        """
        stops = list(self.stops.counts)
        with self._lock:
            self._check_command([move.axis for move in moves], CommandMode.POSITION)
            scale = self.speed.at_start()
            if relative:
                start = self.image.position_command
                moves = [
                    replace(move, target=float(start[move.axis]) + move.target) for move in moves
                ]
            for move in moves:
                with self.naming(move.axis):
                    check_move(self.limits[move.axis], move.target, move.profile)
            scale *= self._limited_scale(moves, scale)
            begin = self._driver.move
            self._begin(moves, stops, lambda a: begin(a.axis, a.target, a.profile.scaled(scale)))

    @logged_command
    def jog(self, jogs: Sequence[Jog]) -> None:
        """Start or change velocity commands together; velocity 0 slows to rest.

        A joint is stopped before it leaves its position limits (``SoftLimitGuard``); a command
        for which that would be too late is rejected, and one that a stop overtakes does not begin.
        Velocities of 0 stop unclaimed axes where the device is not ready for another command.
        """
        self._require(Capability.VELOCITY_MODE, "velocity mode")
        moves = any(jog.profile.velocity for jog in jogs)
        free = [jog.axis for jog in jogs if not self.owner(jog.axis)]
        if free and not moves and not self.connection.ready:
            self._stop(free, quick=False)
        stops = list(self.stops.counts)
        with self._lock:
            self._check_command([jog.axis for jog in jogs], CommandMode.VELOCITY)
            for jog in jogs:
                position = float(self.image.position[jog.axis])
                with self.naming(jog.axis):
                    check_jog(self.limits[jog.axis], position, jog.profile)
            scale = self.speed.at_start() if moves else 1.0
            scale *= self._limited_scale(jogs, scale)
            begin = self._driver.jog
            self._begin(jogs, stops, lambda a: begin(a.axis, a.profile.scaled(scale)))

    def _homing_speed(self, axis: int) -> float:
        """Return the speed at which ``axis`` may home, 0 where it does not move. Raises NotReady.

        The joint that homes moves alone, so that its speed alone decides.
        """
        speed = self._driver.homing_speed(axis)
        if not speed:
            return 0.0
        speed *= self.speed.at_start()
        scales = [limits.scale({axis: speed}, self.image) for limits in self.motion_limits]
        return speed * min(scales, default=1.0)

    def _limited_scale(self, commands: Sequence[Move] | Sequence[Jog], scale: float) -> float:
        """Return what the limits of the groups' speeds leave of ``scale``. Raises NotReady."""
        velocities = {command.axis: command.profile.velocity * scale for command in commands}
        scales = [limit.scale(velocities, self.image) for limit in self.motion_limits]
        return min(scales, default=1.0)

    @logged_command
    def begin_guiding(self, axes: Sequence[int]) -> None:
        """Let idle, enabled ``axes`` be moved by hand, until a stop, a fault or servo off.

        Other commands for them are rejected meanwhile; one that a stop overtakes does not begin.
        """
        self._require(Capability.HAND_GUIDING, HAND_GUIDING)
        stops, timeout_s = list(self.stops.counts), self.connection.settings.servo_timeout_s
        with self._lock:
            self._check_command(axes, CommandMode.POSITION)
            self.speed.at_start()
            for axis in axes:
                self._check_idle(axis, HAND_GUIDING)
            self.given_up.difference_update(axes)
            try:
                with self.naming():
                    self._driver.begin_guiding(axes, timeout_s)
                self._commanded_ns = self.clock.now_ns()
                self._waits.until(lambda: all(self.owner(axis) == HAND_GUIDING for axis in axes))
                for axis in axes:
                    with self.naming(axis):
                        self._check_not_stopped(axis, stops)
                        self.stops.supersede(axis)
            except RobotdError as error:
                if isinstance(error, DeviceTimeout):
                    self.given_up.update(axes)
                with suppress(RobotdError):  # it is repeated; the reason is the first error
                    self.stops.call(axes)
                raise

    @logged_command
    def stop(self, axes: Sequence[int]) -> None:
        """Start a controlled stop; never rejected because of an owner or of the device's state.

        It is repeated until the axes are at rest, also where this call raises because the driver
        did not take it. No effect while the device does not communicate.
        """
        self._stop(axes, quick=False)

    @logged_command
    def quick_stop(self, axes: Sequence[int]) -> None:
        """Start the fastest controlled stop; otherwise as ``stop``."""
        self._stop(axes, quick=True)

    def stop_and_wait(self, axes: Sequence[int], timeout_s: float, *, quick: bool = False) -> None:
        """Stop the axes, or quick-stop them, and wait until they are idle.

        Raises DeviceTimeout naming the axes that still move.
        """
        failure: RobotdError | None = None
        try:
            (self.quick_stop if quick else self.stop)(axes)
        except RobotdError as error:  # it is repeated
            failure = error
        self.wait_for_motion()
        if not wait_until(lambda: not self._moving(axes), timeout_s, self.clock):
            names = ", ".join(self.names[axis] for axis in self._moving(axes))
            reason = f" ({failure})" if failure else ""
            raise DeviceTimeout(f"{names}: not at rest after {timeout_s} s{reason}") from failure

    def wait_for_motion(self) -> None:
        """Wait for an image that shows the last move or jog, if it was accepted.

        Raises NotReady when none comes: an older one proves no standstill.
        """
        self._waits.require_newer(self._commanded_ns)

    @contextmanager
    def kept_at_rest(self, what: str, axes: Sequence[int] = ()) -> Iterator[None]:
        """Let no motion start until the block ends; stops are not delayed.

        Raises NotReady, naming ``what`` and the axis: one of ``axes`` (none: of all) is not free.
        """
        with self._lock:
            for axis in axes or range(len(self)):
                self.check_unclaimed(axis)
                self._check_idle(axis, what)
            yield

    @contextmanager
    def _reserved(self, axis: int, what: str) -> Iterator[None]:
        """Give an idle axis to the command ``what`` until the block ends.

        A command of another thread between the check and the driver's call is rejected.
        """
        with self._lock:
            self.check_unclaimed(axis)
            self._check_idle(axis, what)
            self._owners[axis] = what
        try:
            yield
        finally:
            with self._lock:
                self._owners.pop(axis, None)

    @contextmanager
    def claimed(
        self, owner: str, axes: Sequence[int], mode: CommandMode = CommandMode.POSITION
    ) -> Iterator[None]:
        """Reserve idle, enabled ``axes`` for streaming by ``owner`` until the block ends.

        Where trajectories run on the device, axes in position mode are reserved, not streamed.

        Raises NotReady, with the reason, when an axis cannot be streamed in ``mode`` or is
        claimed.
        """
        streams = mode is not CommandMode.POSITION or not self.trajectories_on_device
        with self._lock:
            self._check_command(axes, mode)
            for axis in axes:
                self._check_idle(axis, owner)
            self.given_up.difference_update(axes)
            if streams:
                with self.naming():
                    self._driver.begin_stream(axes)
            self.hand_over(axes, owner)
        try:
            yield
        finally:
            with self._lock:
                for axis in axes:
                    self._owners.pop(axis, None)
                if streams:
                    self._end_stream(axes)

    def hand_over(self, axes: Sequence[int], owner: str) -> None:
        """Name a new owner of ``axes``, which are claimed and stay so."""
        self._owners.update(dict.fromkeys(axes, owner))

    def rejection(self, axis: int, mode: CommandMode, by: str = "") -> NotReady | None:
        """Return the error of a motion command now, of client ``by``; None: it is accepted."""
        if not self.connection.commandable:
            return NotReady(self.connection.rejection)
        return self.inability(axis, mode, by)

    def inability(self, axis: int, mode: CommandMode, by: str) -> NotReady | None:
        """Return the error of motion in ``mode``, also of one that runs; None: it can move."""
        image = self.image
        if image.fault(axis):
            return self.fault_error(axis)
        if self.owner(axis) == HAND_GUIDING:
            reason = f"in use by {HAND_GUIDING}"
        elif not image.servo_on[axis]:
            reason = "servo is off"
        elif image.mode.item(axis) != mode:
            have = CommandMode(int(image.mode[axis])).name.lower()
            reason = f"in {have} mode, not in {mode.name.lower()} mode"
        elif self.owner(axis) not in ("", by):
            reason = f"in use by {self.owner(axis)}"
        else:
            return None
        return self.error(NotReady, axis, reason)

    def known_commands(self, axes: Sequence[int]) -> FloatArray:
        """Return position commands (m,) in rad or m. Raises NotReady: one is not known."""
        commands = self.image.position_command[list(axes)]
        for axis, command in zip(axes, commands.tolist(), strict=True):
            if not math.isfinite(command):
                raise self.error(NotReady, axis, "the present position is not known")
        return commands

    def _end_stream(self, axes: Sequence[int]) -> None:
        """End streaming and wait until the image shows it; stop axes that go on."""
        try:
            self._driver.end_stream(axes)
        except RobotdError as error:
            log.warning("a stream could not be ended", reason=str(error))
            self.stops.request(axes)
        self._commanded_ns = self.clock.now_ns()
        self._waits.until(lambda: not self._moving(axes))
        if moving := self._moving(axes):
            self.stops.request(moving)

    def _check_command(self, axes: Sequence[int], mode: CommandMode) -> None:
        self.check_axes(axes)
        self.stop_latch.check()
        self._waits.until(lambda: not any(self.stops.failure(axis) for axis in axes))
        for axis in axes:
            if failure := self.stops.failure(axis):
                raise self.error(NotReady, axis, failure)
            if error := self.rejection(axis, mode):
                raise error

    def check_unclaimed(self, axis: int) -> None:
        """Raise as ``check_axes``, and NotReady for an axis that has an owner."""
        self.check_axes([axis])
        if owner := self.owner(axis):
            raise self.error(NotReady, axis, f"in use by {owner}")

    def _check_idle(self, axis: int, what: str) -> None:
        self.wait_for_motion()
        self._waits.until(lambda: not self.stops.is_pending([axis]))
        operation = Operation(int(self.image.operation[axis]))
        if operation is not Operation.IDLE:
            reason = f"{what} needs an idle axis, this one is in {operation.name.lower()}"
            raise self.error(NotReady, axis, reason)
        if self.stops.is_pending([axis]):
            reason = self.stops.failure(axis) or "its stop is not confirmed"
            raise self.error(NotReady, axis, reason)

    def _check_servo_off(self, axis: int, what: str) -> None:
        if not self.image.servo_on[axis]:
            self._waits.require_newer(self.clock.now_ns())  # it may have been switched on just now
        if self.image.servo_on[axis]:
            reason = f"{what} can change only while the servo is off"
            raise self.error(NotReady, axis, reason)

    def fault_error(self, axis: int, advice: str = "") -> NotReady:
        """Return the error of a drive with a fault."""
        if fault := self.image.controller_fault:
            return NotReady(f"{fault}{advice}")
        return self.error(NotReady, axis, f"{self.image.fault(axis)}{advice}")

    def _require(self, capability: Capability | None, feature: str) -> None:
        self.stop_latch.check_commandable()
        if capability is not None and capability not in self._capabilities:
            raise Unsupported(feature, self.backend)

    def _stop(self, axes: Sequence[int], *, quick: bool) -> None:
        self.check_numbers(axes)
        if self.connection.state in COMMUNICATES:
            self.stop_latch.check_commandable()
            with self.naming():
                self.stops.call(axes, quick=quick)

    def _moving(self, axes: Sequence[int]) -> list[int]:
        """Return those that are not known to be at rest."""
        operations, pending = self.image.operation.tolist(), self.stops.is_pending
        return [axis for axis in axes if operations[axis] != Operation.IDLE or pending([axis])]

    def _begin(
        self, commands: Sequence[Command], stops: Sequence[int], begin: Callable[[Command], None]
    ) -> None:
        """Begin motions one after the other; an error stops those that have begun.

        Raises NotReady after a stop since ``stops``.
        """
        begun: list[int] = []
        for command in commands:
            axis = command.axis
            try:
                with self.naming(axis):
                    self._check_not_stopped(axis, stops)
                    self.given_up.discard(axis)
                    begin(replace(command, profile=self.braking.begin(axis, command.profile)))
                    begun.append(axis)
                    self._commanded_ns = self.clock.now_ns()
                    self._check_not_stopped(axis, stops)
                    self.stops.supersede(axis)
            except RobotdError as error:
                if isinstance(error, DeviceTimeout):
                    begun.append(axis)
                    self.given_up.add(axis)
                if begun:
                    with suppress(RobotdError):  # it is repeated; the reason is the first error
                        self.stops.call(begun)
                raise

    def _check_not_stopped(self, axis: int, stops: Sequence[int]) -> None:
        self.stop_latch.check()
        self.connection.require_ready()
        if self.stops.counts[axis] != stops[axis]:
            raise NotReady("stopped before the motion began")
