"""Axis commands: every argument and every state is checked here, once, for all backends."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from robotd.clock import Clock, wait_until
from robotd.device.axis_arguments import AxisArguments
from robotd.device.capabilities import Capability
from robotd.device.command_effect import CommandEffect
from robotd.device.connection import Connection
from robotd.device.drivers import AxisDriver
from robotd.device.motion_starts import MotionStarts
from robotd.device.process_image import ProcessImage
from robotd.device.speed_scale import SpeedScale
from robotd.device.state import CommandMode, Operation
from robotd.device.stop_latch import StopLatch
from robotd.device.stop_requests import StopRequests
from robotd.errors import DeviceTimeout, NotReady, RobotdError, Unsupported
from robotd.events import EventKind, EventLog, noted
from robotd.log import get_logger
from robotd.motion.limits import AxisLimits, check_jog, check_move
from robotd.motion.profile import Profile

log = get_logger("axes")


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


class Axes:
    """The axes of a robot; worker threads only (the control loop calls the driver itself).

    A command on several axes is checked whole before any axis starts. Commands are rejected,
    with the reason, while the engine is not ready, and on an axis that has another owner.

    Checks go by the process image, which is a period behind the device. So a command returns
    when the image shows what it did, and what needs an idle axis looks at an image that is newer
    than the last motion command.

    Args:
        driver: the backend's axes.
        image: the live process image, written by the control loop.
        limits: per axis, in force: those of the device are included.
        names: per axis, for error texts (``joint2`` or ``axis 1``).
        clock: to wait by.
        events: where commands are noted; None: in its own log.

    Attributes:
        arguments: checks that do not depend on the state of the device.
        stop_latch: no motion starts while it is engaged.
        stops: stops that the control loop requests.
        device_limits, feedback_period_s, underrun, stream_buffer_s: of the driver when it was made.
        speed: of all motion.
        jog_deceleration: ramp by which the velocity command of each axis ends, rad/s² or m/s².
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
        self.image = image
        self.limits, self.device_limits = tuple(limits), tuple(driver.device_limits)
        self.feedback_period_s = driver.feedback_period_s
        self.underrun, self.stream_buffer_s = driver.underrun, driver.stream_buffer_s
        self.names = tuple(names)
        self.arguments = AxisArguments(names)
        self.stop_latch = StopLatch(driver.read_only, self._note_repeated_stop)
        self.stops = StopRequests(driver, names)
        self.speed = SpeedScale()
        self.speed.on_change(self._note_speed)
        self.jog_deceleration = [math.inf] * len(names)
        self._driver = driver
        self._connection = connection
        self._capabilities = capabilities
        self._backend = backend
        self._clock = clock
        self._effect = CommandEffect(image, connection, clock, self.feedback_period_s)
        self._owners: dict[int, str] = {}  # of the axes that are claimed
        self._lock = threading.RLock()
        self._starts = MotionStarts(driver, self.stop_latch, self._effect, len(names))

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
        self._connection.require_ready()
        self.arguments.check_numbers(axes)

    @noted
    def servo(self, axis: int, on: bool) -> None:
        """Enable (at the measured position, without a jump) or disable one servo; waits for it.

        Axes that share the servo switch are switched, and checked, with it. Disabling is never
        rejected because of an owner: a stream to the axis is stopped. Enabling is, because
        setpoints from before would be far away, and after a request to end.
        """
        self.check_axes([axis])
        group = self.servo_group(axis)
        with self.arguments.naming(axis):
            if not on:
                self._driver.servo(axis, False, self._connection.settings.servo_timeout_s)
            else:
                self.stop_latch.check_servos()
                with self._connection.parameters.scaling_lock:
                    self._enable(axis, group)
        self._effect.wait_for(lambda: bool((self.image.servo_on[list(group)] == on).all()))

    @noted
    def clear_alarm(self, axis: int) -> None:
        """Clear the amplifier alarm of one axis; waits until it is gone."""
        self._check_axis(axis)
        with self.arguments.naming(axis):
            self._driver.clear_alarm(axis, self._connection.settings.servo_timeout_s)
        self._effect.wait_for(lambda: not self.image.amp_alarm[axis])

    @noted
    def set_command_mode(self, axis: int, mode: int) -> None:
        """Set position (0), velocity (1) or torque (2) mode of an idle axis."""
        self._check_axis(axis)
        self.arguments.check_command_mode(axis, mode)
        needs = {
            CommandMode.VELOCITY: Capability.VELOCITY_MODE,
            CommandMode.TORQUE: Capability.TORQUE_MODE,
        }.get(CommandMode(mode))
        self._require(needs, f"{CommandMode(mode).name.lower()} mode")
        with self._reserved(axis, "the command mode"), self.arguments.naming(axis):
            self._driver.set_command_mode(axis, CommandMode(mode))
            self._effect.wait_for(lambda: bool(self.image.mode[axis] == mode))

    @noted
    def set_polarity(self, axis: int, polarity: int) -> None:
        """1 or -1, with the servo off."""
        self._check_axis(axis)
        self.arguments.check_polarity(axis, polarity)
        self._require(Capability.SCALING, "polarity")
        with self._connection.parameters.scaling_lock, self.arguments.naming(axis):
            self._check_servo_off(axis, "polarity")
            self._driver.set_polarity(axis, polarity)
        self._effect.wait_for_next()

    @noted
    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        """Encoder counts per unit as a fraction, both parts positive, with the servo off."""
        self._check_axis(axis)
        self.arguments.check_gear_ratio(axis, numerator, denominator)
        self._require(Capability.SCALING, "gear ratio")
        with self._connection.parameters.scaling_lock, self.arguments.naming(axis):
            self._check_servo_off(axis, "the gear ratio")
            self._driver.set_gear_ratio(axis, numerator, denominator)
        self._effect.wait_for_next()

    @noted
    def home(self, axis: int) -> None:
        """Make the present position of one idle axis its home position."""
        self._check_axis(axis)
        self.stop_latch.check()
        self._require(Capability.HOMING, "homing")
        with self._reserved(axis, "homing"), self.arguments.naming(axis):
            self._driver.home(axis, self._connection.settings.homing_timeout_s)
            self._effect.wait_for_next()

    @noted
    def move(self, moves: Sequence[Move], *, relative: bool = False) -> None:
        """Start position moves together. Returns when all are accepted, not when they end.

        A relative target counts from the position command. What is stopped meanwhile is not begun.
        """
        stops = self._starts.stops
        with self._lock:
            self._check_command([move.axis for move in moves], CommandMode.POSITION)
            scale = self.speed.at_start()
            if relative:
                start = self.image.position_command
                moves = [
                    replace(move, target=float(start[move.axis]) + move.target) for move in moves
                ]
            for move in moves:
                with self.arguments.naming(move.axis):
                    check_move(self.limits[move.axis], move.target, move.profile)
            for move in moves:
                with self.arguments.naming(move.axis), self._starts.begun(move.axis, stops):
                    self._driver.move(move.axis, move.target, move.profile.scaled(scale))

    @noted
    def jog(self, jogs: Sequence[Jog]) -> None:
        """Start or change velocity commands together; velocity 0 slows to rest.

        A joint is stopped before it leaves its position limits (``SoftLimitGuard``); a command
        for which that would be too late is rejected. What is stopped meanwhile does not begin.
        """
        self._require(Capability.VELOCITY_MODE, "velocity mode")
        stops = self._starts.stops
        with self._lock:
            self._check_command([jog.axis for jog in jogs], CommandMode.VELOCITY)
            for jog in jogs:
                position = float(self.image.position[jog.axis])
                with self.arguments.naming(jog.axis):
                    check_jog(self.limits[jog.axis], position, jog.profile)
            scale = self.speed.at_start() if any(jog.profile.velocity for jog in jogs) else 1.0
            for jog in jogs:
                self.jog_deceleration[jog.axis] = jog.profile.deceleration
                with self.arguments.naming(jog.axis), self._starts.begun(jog.axis, stops):
                    self._driver.jog(jog.axis, jog.profile.scaled(scale))

    @noted
    def stop(self, axes: Sequence[int]) -> None:
        """Controlled stop; never rejected because of an owner. Not ready: no effect."""
        self._stop(axes, self._driver.stop)

    @noted
    def quick_stop(self, axes: Sequence[int]) -> None:
        """The fastest controlled stop; never rejected because of an owner."""
        self._stop(axes, self._driver.quick_stop)

    def rest(self, axes: Sequence[int], timeout_s: float, *, quick: bool = False) -> None:
        """Controlled stop, or a quick one, and wait until the axes are idle.

        Raises DeviceTimeout naming the axes that still move.
        """
        (self.quick_stop if quick else self.stop)(axes)
        self._effect.wait_for_motion()
        if not wait_until(lambda: not self._moving(axes), timeout_s, self._clock):
            names = ", ".join(self.names[axis] for axis in self._moving(axes))
            raise DeviceTimeout(f"{names}: not at rest after {timeout_s} s")

    def wait_for_motion(self) -> None:
        """Wait for an image that shows the last move or jog, if it was accepted."""
        self._effect.wait_for_motion()

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
            if streams:
                with self.arguments.naming():
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
        """The error of a motion command now, of a client named ``by``; None: accepted."""
        image = self.image
        if not self._connection.commandable:
            return NotReady(self._connection.rejection)
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
        return self.arguments.error(NotReady, axis, reason)

    def _end_stream(self, axes: Sequence[int]) -> None:
        """End streaming and wait until the image shows it; log a failure."""
        try:
            self._driver.end_stream(axes)
        except RobotdError as error:
            log.warning("a stream could not be ended", reason=str(error))
        self._effect.wait_for(lambda: not self._moving(axes))

    def _enable(self, axis: int, group: Sequence[int]) -> None:
        connection, timeout_s = self._connection, self._connection.settings.servo_timeout_s
        connection.require_ready()
        connection.require_alive()
        self._require_position(group)
        for other in group:
            if self.image.amp_alarm[other]:
                raise self._fault_error(other, "; clear it first")
            if not self.image.servo_on[other]:
                self._check_axis(other)
        self._driver.servo(axis, True, timeout_s)
        if connection.ending:  # the request came while the drive was enabling
            self._driver.servo(axis, False, timeout_s)
            connection.require_alive()

    def _require_position(self, axes: Sequence[int]) -> None:
        """Wait for the first positions of a new connection; raise NotReady where one is missing.

        An axis is enabled at its measured position: at an unknown one it would jump.
        """
        image = self.image
        self._effect.wait_for_first(lambda: bool(np.isfinite(image.position[list(axes)]).all()))
        for axis in axes:
            if not math.isfinite(image.position[axis]):
                known = image.fault(axis) or "the device has not reported it"
                raise self.arguments.error(NotReady, axis, f"position is not known: {known}")

    def _check_command(self, axes: Sequence[int], mode: CommandMode) -> None:
        self.check_axes(axes)
        self.stop_latch.check()
        for axis in axes:
            if error := self.rejection(axis, mode):
                raise error

    def _check_axis(self, axis: int) -> None:
        self.check_axes([axis])
        if owner := self.owner(axis):
            raise self.arguments.error(NotReady, axis, f"in use by {owner}")

    def _check_idle(self, axis: int, what: str) -> None:
        self._effect.wait_for_motion()
        operation = Operation(int(self.image.operation[axis]))
        if operation is not Operation.IDLE:
            reason = f"{what} needs an idle axis, this one is in {operation.name.lower()}"
            raise self.arguments.error(NotReady, axis, reason)

    def _check_servo_off(self, axis: int, what: str) -> None:
        if self.image.servo_on[axis]:
            reason = f"{what} can change only while the servo is off"
            raise self.arguments.error(NotReady, axis, reason)

    def _fault_error(self, axis: int, advice: str = "") -> NotReady:
        if fault := self.image.controller_fault:
            return NotReady(f"{fault}{advice}")
        return self.arguments.error(NotReady, axis, f"{self.image.fault(axis)}{advice}")

    def _require(self, capability: Capability | None, feature: str) -> None:
        self.stop_latch.check_commandable()
        if capability is not None and capability not in self._capabilities:
            raise Unsupported(feature, self._backend)

    def _stop(self, axes: Sequence[int], stop: Callable[[Sequence[int]], None]) -> None:
        if self._connection.ready:
            self.check_axes(axes)
            self._starts.note_stop(axes)
            with self.arguments.naming():
                stop(axes)

    def _moving(self, axes: Sequence[int]) -> list[int]:
        return [axis for axis in axes if self.image.operation[axis] != Operation.IDLE]
