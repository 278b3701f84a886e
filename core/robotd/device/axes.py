"""Commands of single axes, with all checks of arguments and states, for all backends."""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import Clock, wait_until
from robotd.device.capabilities import Capability
from robotd.device.connection import Connection
from robotd.device.drivers import AxisDriver
from robotd.device.motion_limits import MotionLimits
from robotd.device.process_image import ProcessImage
from robotd.device.speed_scale import SpeedScale
from robotd.device.state import COMMUNICATES, CommandMode, Operation
from robotd.device.stops import StopLatch, StopRequests
from robotd.errors import DeviceTimeout, InvalidArgument, NotReady, RobotdError, Unsupported
from robotd.events import EventKind, EventLog, logged_command
from robotd.log import get_logger
from robotd.motion.limits import AxisLimits, check_jog, check_move
from robotd.motion.profile import Profile

log = get_logger("axes")

Error = TypeVar("Error", bound=RobotdError)

MIN_RATIO_PART, MAX_RATIO_PART = 1e-6, 2**31 - 1  # of a gear ratio's numerator and denominator
IMAGE_LATENCY_S = 0.1  # for the image, a period or two behind, to show what a driver has reported
FEEDBACK_LATENCY_PERIODS = 3  # slow feedback periods in which it does
FIRST_VALUES_TIMEOUT_S = 1.0  # that a command needs: of a new connection, or after a stall


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


class Axes:
    """The axes of a robot; worker threads only (the control loop calls the driver itself).

    A command on several axes is checked whole before any axis starts. Commands are rejected,
    with the reason, while the engine is not ready, and on an axis that has another owner.

    Checks go by the process image, which is a period behind the device. So a command returns
    when the image shows what it did, and what needs an idle axis looks at an image that is newer
    than the last motion command or stream. An image is as new as its values.

    A driver may take its time to begin a motion, and no stop waits for it: stops are counted, and
    what was stopped meanwhile is stopped again when the driver has begun it.

    Args:
        limits: per axis, in force: those of the device are included.
        names: per axis, for error texts (``joint2`` or ``axis 1``).
        events: where commands are noted; None: in its own log.

    Attributes:
        image, connection, clock: of the robot; ``clock`` is to wait by.
        backend: name, for errors.
        stop_latch: no motion starts while it is engaged.
        stops: stops that the control loop requests.
        device_limits, feedback_period_s, underrun, stream_buffer_s: of the driver when it was made.
        speed: of all motion.
        motion_limits: of the joint groups.
        deceleration: ramp by which the move or velocity command of each axis ends, rad/s² or m/s².
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
        events: EventLog | None = None,
    ) -> None:
        self.events = events or EventLog(clock.now_ns)
        self.image, self.connection, self.clock, self.backend = image, connection, clock, backend
        self.limits, self.device_limits = tuple(limits), tuple(driver.device_limits)
        self.feedback_period_s = driver.feedback_period_s
        self.underrun, self.stream_buffer_s = driver.underrun, driver.stream_buffer_s
        self.names = tuple(names)
        self.stop_latch = StopLatch(driver.read_only, self._note_repeated_stop)
        self.stops = StopRequests(driver, names)
        self.speed = SpeedScale()
        self.speed.on_change(self._note_speed)
        self.motion_limits: list[MotionLimits] = []
        self.deceleration = [math.inf] * len(names)
        self.given_up: set[int] = set()
        self._driver = driver
        self._capabilities = capabilities
        self._shown_s = max(IMAGE_LATENCY_S, FEEDBACK_LATENCY_PERIODS * self.feedback_period_s)
        self._commanded_ns = 0  # time of the last motion command, or end of a stream
        self._stops = [0] * len(names)  # number of stops of each axis so far
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

    def __len__(self) -> int:
        return len(self.names)

    def servo_group(self, axis: int) -> tuple[int, ...]:
        """Return the axes that share the servo switch of ``axis``, itself included."""
        groups = (tuple(group) for group in self._driver.servo_groups)
        return next((group for group in groups if axis in group), (axis,))

    def owner(self, axis: int) -> str:
        """Return the owner that has claimed ``axis``; "" without one. Any thread."""
        return self._owners.get(axis, "")

    def check_axes(self, axes: Sequence[int]) -> None:
        """Raise NotReady before the device is ready, InvalidArgument for a wrong axis.

        OperationError where axes are read-only. Part of every command. Any thread.
        """
        self.stop_latch.check_commandable()
        self.connection.require_ready()
        self.check_numbers(axes)

    def check_numbers(self, axes: Sequence[int]) -> None:
        """Raise InvalidArgument unless there is an axis, each exists, and none is given twice.

        This check and the following ones do not depend on the state of the device. A caller that
        takes one request for several axes makes them first, so that a wrong entry rejects the
        request as a whole. Any thread.
        """
        if not axes:
            raise InvalidArgument("no axis given")
        for axis in axes:
            if not 0 <= axis < len(self.names):
                raise InvalidArgument(f"axis {axis} is outside 0..{len(self.names) - 1}")
        if len(set(axes)) < len(axes):
            doubled = min(axis for axis, count in Counter(axes).items() if count > 1)
            raise InvalidArgument(f"axis {doubled} is given twice")

    def check_command_mode(self, axis: int, mode: int) -> None:
        """Raise InvalidArgument for a number that is no ``CommandMode``."""
        if mode not in tuple(CommandMode):
            raise self._error(InvalidArgument, axis, f"mode {mode} is not 0, 1 or 2")

    def check_polarity(self, axis: int, polarity: int) -> None:
        """Raise InvalidArgument for another number than 1 and -1."""
        if polarity not in (1, -1):
            raise self._error(InvalidArgument, axis, f"polarity {polarity} is not 1 or -1")

    def check_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        """Raise InvalidArgument for a part that is not within 1e-6 to 2147483647."""
        for part, value in (("numerator", numerator), ("denominator", denominator)):
            if not (math.isfinite(value) and MIN_RATIO_PART <= value <= MAX_RATIO_PART):
                reason = f"gear ratio {part} {value} is outside 1e-06..2147483647"
                raise self._error(InvalidArgument, axis, reason)

    @logged_command
    def servo(self, axis: int, on: bool) -> None:
        """Enable (at the measured position, without a jump) or disable one servo; waits for it.

        Axes that share the servo switch are switched, and checked, with it. Disabling is never
        rejected because of an owner: a stream to the axis is stopped. Enabling is, because
        setpoints from before would be far away, and after a request to end. A servo that does not
        enable in time is disabled.
        """
        self.check_axes([axis])
        group, connection = self.servo_group(axis), self.connection
        timeout_s = connection.settings.servo_timeout_s
        with self._naming(axis):
            if not on:
                self._driver.servo(axis, False, timeout_s)
            else:
                self.stop_latch.check_servos()
                with connection.scaling_lock:
                    connection.require_ready()
                    connection.require_alive()
                    self._require_position(group)
                    for other in group:
                        if self.image.amp_alarm[other]:
                            raise self._fault_error(other, "; clear it first")
                        if not self.image.servo_on[other]:
                            self._check_axis(other)
                    try:
                        self._driver.servo(axis, True, timeout_s)
                    except DeviceTimeout:
                        # A call that was given up may go on: the drive must not enable later.
                        if not self.image.servo_on[axis]:
                            with suppress(RobotdError):
                                self._driver.servo(axis, False, timeout_s)
                        raise
                    # A request to end, or to be inactive, may have come while the drive enabled.
                    if connection.ending or not self.stop_latch.servos_allowed:
                        self._driver.servo(axis, False, timeout_s)
                        connection.require_alive()
                        self.stop_latch.check_servos()
        self._wait_for(lambda: bool((self.image.servo_on[list(group)] == on).all()))

    @logged_command
    def clear_alarm(self, axis: int) -> None:
        """Clear the amplifier alarm of one axis; waits until it is gone."""
        self._check_axis(axis)
        with self._naming(axis):
            self._driver.clear_alarm(axis, self.connection.settings.servo_timeout_s)
        self._wait_for(lambda: not self.image.amp_alarm[axis])

    @logged_command
    def set_command_mode(self, axis: int, mode: int) -> None:
        """Set position (0), velocity (1) or torque (2) mode of an idle axis."""
        self._check_axis(axis)
        self.check_command_mode(axis, mode)
        needs = {
            CommandMode.VELOCITY: Capability.VELOCITY_MODE,
            CommandMode.TORQUE: Capability.TORQUE_MODE,
        }.get(CommandMode(mode))
        self._require(needs, f"{CommandMode(mode).name.lower()} mode")
        with self._reserved(axis, "the command mode"), self._naming(axis):
            self._driver.set_command_mode(axis, CommandMode(mode))
            self._wait_for(lambda: bool(self.image.mode[axis] == mode))

    @logged_command
    def set_polarity(self, axis: int, polarity: int) -> None:
        """Set polarity 1 or -1, with the servo off."""
        self._check_axis(axis)
        self.check_polarity(axis, polarity)
        self._require(Capability.SCALING, "polarity")
        with self.connection.scaling_lock, self._naming(axis):
            self._check_servo_off(axis, "polarity")
            self._driver.set_polarity(axis, polarity)
        self._wait_for_newer(self.clock.now_ns())

    @logged_command
    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        """Set encoder counts per unit, a fraction of positive parts, with the servo off."""
        self._check_axis(axis)
        self.check_gear_ratio(axis, numerator, denominator)
        self._require(Capability.SCALING, "gear ratio")
        with self.connection.scaling_lock, self._naming(axis):
            self._check_servo_off(axis, "the gear ratio")
            self._driver.set_gear_ratio(axis, numerator, denominator)
        self._wait_for_newer(self.clock.now_ns())

    @logged_command
    def home(self, axis: int) -> None:
        """Make the present position of one idle axis its home position."""
        self._check_axis(axis)
        self.stop_latch.check()
        self._require(Capability.HOMING, "homing")
        with self._reserved(axis, "homing"), self._naming(axis):
            self.given_up.discard(axis)
            try:
                self._driver.home(axis, self.connection.settings.homing_timeout_s)
            except DeviceTimeout:
                self.given_up.add(axis)
                raise
            self._wait_for_newer(self.clock.now_ns())

    @logged_command
    def move(self, moves: Sequence[Move], *, relative: bool = False) -> None:
        """Start position moves together. Returns when all are accepted, not when they end.

        A relative target counts from the position command. What is stopped meanwhile is not begun.
        """
        stops = list(self._stops)
        with self._lock:
            self._check_command([move.axis for move in moves], CommandMode.POSITION)
            scale = self.speed.at_start()
            if relative:
                start = self.image.position_command
                moves = [
                    replace(move, target=float(start[move.axis]) + move.target) for move in moves
                ]
            for move in moves:
                with self._naming(move.axis):
                    check_move(self.limits[move.axis], move.target, move.profile)
            scale *= self._limited_scale(moves, scale)
            begin = self._driver.move
            self._begin(moves, stops, lambda a: begin(a.axis, a.target, a.profile.scaled(scale)))

    @logged_command
    def jog(self, jogs: Sequence[Jog]) -> None:
        """Start or change velocity commands together; velocity 0 slows to rest.

        A joint is stopped before it leaves its position limits (``SoftLimitGuard``); a command
        for which that would be too late is rejected. What is stopped meanwhile does not begin.
        """
        self._require(Capability.VELOCITY_MODE, "velocity mode")
        stops = list(self._stops)
        with self._lock:
            self._check_command([jog.axis for jog in jogs], CommandMode.VELOCITY)
            for jog in jogs:
                position = float(self.image.position[jog.axis])
                with self._naming(jog.axis):
                    check_jog(self.limits[jog.axis], position, jog.profile)
            scale = self.speed.at_start() if any(jog.profile.velocity for jog in jogs) else 1.0
            scale *= self._limited_scale(jogs, scale)
            begin = self._driver.jog
            self._begin(jogs, stops, lambda a: begin(a.axis, a.profile.scaled(scale)))

    def _limited_scale(self, commands: Sequence[Move] | Sequence[Jog], scale: float) -> float:
        """Return what the limits of the groups' speeds leave of ``scale``. Raises NotReady."""
        velocities = {each.axis: each.profile.velocity * scale for each in commands}
        scales = [each.scale(velocities, self.image) for each in self.motion_limits]
        return min(scales, default=1.0)

    @logged_command
    def stop(self, axes: Sequence[int]) -> None:
        """Start a controlled stop; never rejected because of an owner.

        Also while values are stale or the state of the device is unknown. No effect while it does
        not communicate.
        """
        self._stop(axes, self._driver.stop)

    @logged_command
    def quick_stop(self, axes: Sequence[int]) -> None:
        """Start the fastest controlled stop; otherwise as ``stop``."""
        self._stop(axes, self._driver.quick_stop)

    def stop_and_wait(self, axes: Sequence[int], timeout_s: float, *, quick: bool = False) -> None:
        """Stop the axes, or quick-stop them, and wait until they are idle.

        Raises DeviceTimeout naming the axes that still move.
        """
        (self.quick_stop if quick else self.stop)(axes)
        self.wait_for_motion()
        if not wait_until(lambda: not self._moving(axes), timeout_s, self.clock):
            names = ", ".join(self.names[axis] for axis in self._moving(axes))
            raise DeviceTimeout(f"{names}: not at rest after {timeout_s} s")

    def wait_for_servos(self) -> bool:
        """Wait for a servo that is being switched on, and until the image shows it.

        Returns False where no such image comes, as in a control-loop stall.
        """
        with self.connection.scaling_lock:
            switched_ns = self.clock.now_ns()
        self._wait_for_newer(switched_ns)
        return self._is_newer(switched_ns)

    def wait_for_motion(self) -> None:
        """Wait for an image that shows the last move or jog, if it was accepted.

        Raises NotReady when none comes: an older one proves no standstill.
        """
        self._require_newer(self._commanded_ns)

    @contextmanager
    def kept_at_rest(self, what: str) -> Iterator[None]:
        """Let no motion start until the block ends; stops are not delayed.

        Raises NotReady, naming ``what`` and the axis, unless every axis is idle and unclaimed.
        """
        with self._lock:
            for axis in range(len(self)):
                self._check_axis(axis)
                self._check_idle(axis, what)
            yield

    @contextmanager
    def _reserved(self, axis: int, what: str) -> Iterator[None]:
        """Give an idle axis to the command ``what`` until the block ends.

        A command of another thread between the check and the driver's call is rejected.
        """
        with self._lock:
            self._check_axis(axis)
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
                with self._naming():
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
            return self._fault_error(axis)
        if not image.servo_on[axis]:
            reason = "servo is off"
        elif image.mode[axis] != mode:
            have = CommandMode(int(image.mode[axis])).name.lower()
            reason = f"in {have} mode, not in {mode.name.lower()} mode"
        elif self.owner(axis) not in ("", by):
            reason = f"in use by {self.owner(axis)}"
        else:
            return None
        return self._error(NotReady, axis, reason)

    def known_commands(self, axes: Sequence[int]) -> FloatArray:
        """Return position commands (m,) in rad or m. Raises NotReady: one is not known."""
        commands = self.image.position_command[list(axes)]
        for axis, command in zip(axes, commands.tolist(), strict=True):
            if not math.isfinite(command):
                raise self._error(NotReady, axis, "the present position is not known")
        return commands

    def _end_stream(self, axes: Sequence[int]) -> None:
        """End streaming and wait until the image shows it; log a failure."""
        try:
            self._driver.end_stream(axes)
        except RobotdError as error:
            log.warning("a stream could not be ended", reason=str(error))
        self._commanded_ns = self.clock.now_ns()
        self._wait_for(lambda: not self._moving(axes))

    def _require_position(self, axes: Sequence[int]) -> None:
        """Wait for the first positions of a new connection; raise NotReady where one is missing.

        An axis is enabled at its measured position: at an unknown one it would jump.
        """
        image = self.image
        self._wait_for(
            lambda: bool(np.isfinite(image.position[list(axes)]).all()),
            at_least_s=FIRST_VALUES_TIMEOUT_S,
        )
        for axis in axes:
            if not math.isfinite(image.position[axis]):
                known = image.fault(axis) or "the device has not reported it"
                raise self._error(NotReady, axis, f"position is not known: {known}")

    def _check_command(self, axes: Sequence[int], mode: CommandMode) -> None:
        self.check_axes(axes)
        self.stop_latch.check()
        for axis in axes:
            if error := self.rejection(axis, mode):
                raise error

    def _check_axis(self, axis: int) -> None:
        self.check_axes([axis])
        if owner := self.owner(axis):
            raise self._error(NotReady, axis, f"in use by {owner}")

    def _check_idle(self, axis: int, what: str) -> None:
        self.wait_for_motion()
        operation = Operation(int(self.image.operation[axis]))
        if operation is not Operation.IDLE:
            reason = f"{what} needs an idle axis, this one is in {operation.name.lower()}"
            raise self._error(NotReady, axis, reason)

    def _check_servo_off(self, axis: int, what: str) -> None:
        if not self.image.servo_on[axis]:
            self._require_newer(self.clock.now_ns())  # it may have been switched on just now
        if self.image.servo_on[axis]:
            reason = f"{what} can change only while the servo is off"
            raise self._error(NotReady, axis, reason)

    def _fault_error(self, axis: int, advice: str = "") -> NotReady:
        if fault := self.image.controller_fault:
            return NotReady(f"{fault}{advice}")
        return self._error(NotReady, axis, f"{self.image.fault(axis)}{advice}")

    def _require(self, capability: Capability | None, feature: str) -> None:
        self.stop_latch.check_commandable()
        if capability is not None and capability not in self._capabilities:
            raise Unsupported(feature, self.backend)

    def _stop(self, axes: Sequence[int], stop: Callable[[Sequence[int]], None]) -> None:
        if self.connection.established and self.connection.state in COMMUNICATES:
            self.stop_latch.check_commandable()
            self.check_numbers(axes)
            for axis in axes:
                self._stops[axis] += 1
            with self._naming():
                stop(axes)

    def _moving(self, axes: Sequence[int]) -> list[int]:
        return [axis for axis in axes if self.image.operation[axis] != Operation.IDLE]

    def _wait_for(self, condition: Callable[[], bool], at_least_s: float = 0.0) -> None:
        """Wait until the image shows ``condition``, by which the next command is judged.

        Not for long, and no longer than the device is ready.
        """
        timeout_s = max(at_least_s, self._shown_s)
        wait_until(lambda: condition() or not self.connection.ready, timeout_s, self.clock)

    def _wait_for_newer(self, time_ns: int, at_least_s: float = 0.0) -> None:
        """Wait for an image that is newer than ``time_ns``."""
        self._wait_for(lambda: self._is_newer(time_ns), at_least_s)

    def _require_newer(self, time_ns: int) -> None:
        """Wait for an image that is newer than ``time_ns``. Raises NotReady: none comes."""
        self._wait_for_newer(time_ns, FIRST_VALUES_TIMEOUT_S)
        if not self._is_newer(time_ns):
            self.connection.require_ready()
            raise NotReady("the device has sent no values since the last command")

    def _is_newer(self, time_ns: int) -> bool:
        return self.image.fresh_ns > time_ns

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
                with self._naming(axis):
                    self._check_not_stopped(axis, stops)
                    self.deceleration[axis] = command.profile.deceleration
                    self.given_up.discard(axis)
                    begin(command)
                    begun.append(axis)
                    self._commanded_ns = self.clock.now_ns()
                    self._check_not_stopped(axis, stops)
            except RobotdError as error:
                if isinstance(error, DeviceTimeout):
                    begun.append(axis)
                    self.given_up.add(axis)
                if begun:
                    self._driver.stop(begun)
                raise

    def _check_not_stopped(self, axis: int, stops: Sequence[int]) -> None:
        self.stop_latch.check()
        if self._stops[axis] != stops[axis]:
            raise NotReady("stopped before the motion began")

    def _error(self, kind: type[Error], axis: int, reason: str) -> Error:
        """Return an error of ``axis``, which its text names."""
        error = kind(reason, axis=axis)
        error.axis_name = self.names[axis]
        return error

    @contextmanager
    def _naming(self, axis: int | None = None) -> Iterator[None]:
        """Complete the errors of a driver: the commanded ``axis``, and the axis' name."""
        try:
            yield
        except RobotdError as error:
            if error.axis is None and not isinstance(error, Unsupported):
                error.axis = axis
            if error.axis is not None:
                error.axis_name = self.names[error.axis]
            raise
