"""Axis commands: every argument and every state is checked here, once, for all backends."""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

from robotd.clock import Clock, wait_until
from robotd.device.capabilities import Capability
from robotd.device.connection import Connection
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, Operation, Underrun
from robotd.errors import DeviceTimeout, InvalidArgument, NotReady, RobotdError, Unsupported
from robotd.log import get_logger
from robotd.motion.limits import AxisLimits, check_jog, check_move, check_room
from robotd.motion.profile import Profile

log = get_logger("axes")

Error = TypeVar("Error", bound=RobotdError)

SHOWN_S = 0.1  # for the image, a period or two behind, to show what a driver has reported


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
    """The axes of a robot; worker threads only (the cycle calls the driver itself).

    A command on several axes is checked whole before any axis starts. Commands are refused,
    with the reason, while the engine is not ready, and on an axis that somebody has claimed.

    Checks go by the process image, which is a period behind the device. So a command returns
    when the image shows what it did, and what needs an idle axis looks at an image that is newer
    than the last motion command.

    Args:
        driver: the backend's axes.
        image: the live process image, written by the cycle.
        limits: per axis; an axis without limits (NaN) is not limited.
        names: per axis, for error texts (``joint2`` or ``axis 1``).
        clock: to wait by.

    Attributes:
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
    ) -> None:
        self.image = image
        self.limits = tuple(limits)
        self.names = tuple(names)
        self.jog_deceleration = [math.inf] * len(names)
        self._driver = driver
        self._connection = connection
        self._capabilities = capabilities
        self._backend = backend
        self._clock = clock
        self._owners: dict[int, str] = {}
        self._commanded_ns = 0
        self._lock = threading.RLock()

    @property
    def trajectories_on_device(self) -> bool:
        """True where the device interpolates trajectories itself, see ``AxisDriver.follow``."""
        able = Capability.TRAJECTORIES_ON_DEVICE in self._capabilities
        return able and self._driver.follows_trajectories

    @property
    def underrun(self) -> Underrun:
        """``AxisDriver.underrun``."""
        return self._driver.underrun

    @property
    def stream_buffer_s(self) -> float:
        """``AxisDriver.stream_buffer_s``."""
        return self._driver.stream_buffer_s

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
        """Raise NotReady before the device is ready, else as ``check_numbers``. Any thread.

        This and the checks below are part of every command. A caller that takes one request for
        several axes makes them first, so that a wrong entry rejects the request as a whole.
        """
        self._connection.require_ready()
        self.check_numbers(axes)

    def check_numbers(self, axes: Sequence[int]) -> None:
        """Raise InvalidArgument unless there is an axis, each exists, and none is given twice."""
        if not axes:
            raise InvalidArgument("no axis given")
        for axis in axes:
            if not 0 <= axis < len(self):
                raise InvalidArgument(f"axis {axis} is outside 0..{len(self) - 1}")
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
            if not (math.isfinite(value) and 1e-6 <= value <= 2**31 - 1):
                reason = f"gear ratio {part} {value} is outside 1e-06..2147483647"
                raise self._error(InvalidArgument, axis, reason)

    def servo(self, axis: int, on: bool) -> None:
        """Enable (at the measured position, without a jump) or disable one servo; waits for it.

        Axes that share the servo switch are switched, and checked, with it. Disabling is never
        rejected because of an owner: a stream to the axis is stopped. Enabling is, because
        setpoints from before would be far away, and after a request to end.
        """
        self.check_axes([axis])
        group = self.servo_group(axis)
        with self._commanding(axis):
            if not on:
                self._driver.servo(axis, False, self._connection.settings.servo_timeout_s)
            else:
                with self._connection.scaling_lock:
                    self._enable(axis, group)
        self._see(lambda: bool((self.image.servo_on[list(group)] == on).all()))

    def clear_alarm(self, axis: int) -> None:
        """Clear the amplifier alarm of one axis; waits until it is gone."""
        self._check_axis(axis)
        with self._commanding(axis):
            self._driver.clear_alarm(axis, self._connection.settings.servo_timeout_s)
        self._see(lambda: not self.image.amp_alarm[axis])

    def set_command_mode(self, axis: int, mode: int) -> None:
        """Set position (0), velocity (1) or torque (2) mode of an idle axis."""
        self._check_axis(axis)
        self.check_command_mode(axis, mode)
        needs = {
            CommandMode.VELOCITY: Capability.VELOCITY_MODE,
            CommandMode.TORQUE: Capability.TORQUE_MODE,
        }.get(CommandMode(mode))
        self._require(needs, f"{CommandMode(mode).name.lower()} mode")
        self._check_idle(axis, "the command mode")
        with self._commanding(axis):
            self._driver.set_command_mode(axis, CommandMode(mode))
        self._see(lambda: bool(self.image.mode[axis] == mode))

    def set_polarity(self, axis: int, polarity: int) -> None:
        """1 or -1, with the servo off."""
        self._check_axis(axis)
        self.check_polarity(axis, polarity)
        self._require(Capability.SCALING, "polarity")
        with self._connection.scaling_lock, self._commanding(axis):
            self._check_servo_off(axis, "polarity")
            self._driver.set_polarity(axis, polarity)
        self._see_newer(self._clock.now_ns())

    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        """Encoder counts per unit as a fraction, both parts positive, with the servo off."""
        self._check_axis(axis)
        self.check_gear_ratio(axis, numerator, denominator)
        self._require(Capability.SCALING, "gear ratio")
        with self._connection.scaling_lock, self._commanding(axis):
            self._check_servo_off(axis, "the gear ratio")
            self._driver.set_gear_ratio(axis, numerator, denominator)
        self._see_newer(self._clock.now_ns())

    def home(self, axis: int) -> None:
        """Make the present position of one idle axis its home position."""
        self._check_axis(axis)
        self._require(Capability.HOMING, "homing")
        self._check_idle(axis, "homing")
        with self._commanding(axis):
            self._driver.home(axis, self._connection.settings.homing_timeout_s)
        self._see_newer(self._clock.now_ns())

    def move(self, moves: Sequence[Move], *, relative: bool = False) -> None:
        """Start position moves together. Returns when all are accepted, not when they end.

        A relative target counts from the position command.
        """
        with self._lock:
            self._check_command([move.axis for move in moves], CommandMode.POSITION)
            absolute = [self._absolute(move, relative) for move in moves]
            for move in absolute:
                with self._commanding(move.axis):
                    check_move(self.limits[move.axis], move.target, *_numbers(move.profile))
            for move in absolute:
                with self._commanding(move.axis):
                    self._driver.move(move.axis, move.target, move.profile)
                self._commanded_ns = self._clock.now_ns()

    def jog(self, jogs: Sequence[Jog]) -> None:
        """Start or change velocity commands together; velocity 0 slows to rest.

        A joint is stopped before it leaves its position limits (``SoftLimitGuard``); a command
        for which that would be too late is refused.
        """
        self._require(Capability.VELOCITY_MODE, "velocity mode")
        with self._lock:
            self._check_command([jog.axis for jog in jogs], CommandMode.VELOCITY)
            for jog in jogs:
                limits, position = self.limits[jog.axis], float(self.image.position[jog.axis])
                with self._commanding(jog.axis):
                    check_jog(limits, *_numbers(jog.profile))
                    check_room(limits, position, jog.profile.velocity, jog.profile.deceleration)
            for jog in jogs:
                self.jog_deceleration[jog.axis] = jog.profile.deceleration
                with self._commanding(jog.axis):
                    self._driver.jog(jog.axis, jog.profile)
                self._commanded_ns = self._clock.now_ns()

    def stop(self, axes: Sequence[int]) -> None:
        """Controlled stop; never refused because of an owner. Not ready: no effect."""
        self._stop(axes, self._driver.stop)

    def quick_stop(self, axes: Sequence[int]) -> None:
        """The fastest controlled stop; never refused because of an owner."""
        self._stop(axes, self._driver.quick_stop)

    def rest(self, axes: Sequence[int], timeout_s: float, *, quick: bool = False) -> None:
        """Controlled stop, or a quick one, and wait until the axes are idle.

        Raises DeviceTimeout naming the axes that still move.
        """
        (self.quick_stop if quick else self.stop)(axes)
        self._see_newer(self._commanded_ns)
        if not wait_until(lambda: not self._moving(axes), timeout_s, self._clock):
            names = ", ".join(self.names[axis] for axis in self._moving(axes))
            raise DeviceTimeout(f"{names}: not at rest after {timeout_s} s")

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
                with self._commanding():
                    self._driver.begin_stream(axes)
            self._owners.update(dict.fromkeys(axes, owner))
        try:
            yield
        finally:
            with self._lock:
                for axis in axes:
                    self._owners.pop(axis, None)
                if streams:
                    self._end_stream(axes)

    def rejection(self, axis: int, mode: CommandMode, by: str = "") -> NotReady | None:
        """The error of a motion command now, of a client named ``by``; None: accepted."""
        image = self.image
        if not self._connection.commandable:
            return NotReady(self._connection.rejection)
        if image.fault(axis):
            return self._fault_error(axis)
        owner = self._owners.get(axis)
        reason = ""
        if not image.servo_on[axis]:
            reason = "servo is off"
        if not reason and image.mode[axis] != mode:
            have = CommandMode(int(image.mode[axis])).name.lower()
            reason = f"in {have} mode, not in {mode.name.lower()} mode"
        if not reason and owner and owner != by:
            reason = f"in use by {owner}"
        return self._error(NotReady, axis, reason) if reason else None

    def _enable(self, axis: int, group: Sequence[int]) -> None:
        connection, timeout_s = self._connection, self._connection.settings.servo_timeout_s
        connection.require_ready()
        connection.require_alive()
        for other in group:
            if self.image.amp_alarm[other]:
                raise self._fault_error(other, "; clear it first")
            if not self.image.servo_on[other]:
                self._check_axis(other)
        self._driver.servo(axis, True, timeout_s)
        if connection.ending:  # the request came while the drive was enabling
            self._driver.servo(axis, False, timeout_s)
            connection.require_alive()

    def _check_command(self, axes: Sequence[int], mode: CommandMode) -> None:
        self.check_axes(axes)
        for axis in axes:
            if error := self.rejection(axis, mode):
                raise error

    def _check_axis(self, axis: int) -> None:
        self.check_axes([axis])
        if owner := self._owners.get(axis):
            raise self._error(NotReady, axis, f"in use by {owner}")

    def _check_idle(self, axis: int, what: str) -> None:
        self._see_newer(self._commanded_ns)
        operation = Operation(int(self.image.operation[axis]))
        if operation is not Operation.IDLE:
            reason = f"{what} needs an idle axis, this one is in {operation.name.lower()}"
            raise self._error(NotReady, axis, reason)

    def _check_servo_off(self, axis: int, what: str) -> None:
        if self.image.servo_on[axis]:
            reason = f"{what} can change only while the servo is off"
            raise self._error(NotReady, axis, reason)

    def _absolute(self, move: Move, relative: bool) -> Move:
        if not relative:
            return move
        start = float(self.image.position_command[move.axis])
        return Move(move.axis, start + move.target, move.profile)

    def _fault_error(self, axis: int, advice: str = "") -> NotReady:
        if fault := self.image.controller_fault:
            return NotReady(f"{fault}{advice}")
        return self._error(NotReady, axis, f"{self.image.fault(axis)}{advice}")

    def _error(self, kind: type[Error], axis: int, reason: str) -> Error:
        error = kind(reason, axis=axis)
        error.axis_name = self.names[axis]
        return error

    @contextmanager
    def _commanding(self, axis: int | None = None) -> Iterator[None]:
        """Complete the driver's errors: the commanded ``axis``, and the axis' name."""
        try:
            yield
        except RobotdError as error:
            if error.axis is None and not isinstance(error, Unsupported):
                error.axis = axis
            if error.axis is not None:
                error.axis_name = self.names[error.axis]
            raise

    def _require(self, capability: Capability | None, feature: str) -> None:
        if capability is not None and capability not in self._capabilities:
            raise Unsupported(feature, self._backend)

    def _stop(self, axes: Sequence[int], stop: Callable[[Sequence[int]], None]) -> None:
        if self._connection.ready:
            self.check_axes(axes)
            with self._commanding():
                stop(axes)

    def _moving(self, axes: Sequence[int]) -> list[int]:
        return [axis for axis in axes if self.image.operation[axis] != Operation.IDLE]

    def _end_stream(self, axes: Sequence[int]) -> None:
        try:
            self._driver.end_stream(axes)
        except RobotdError as error:  # of a device that is gone; the block has its own outcome
            log.warning("a stream could not be ended", reason=str(error))
        self._see(lambda: not self._streaming(axes))

    def _streaming(self, axes: Sequence[int]) -> bool:
        return any(self.image.operation[axis] == Operation.STREAM for axis in axes)

    def _see(self, condition: Callable[[], bool]) -> None:
        """Let the image catch up with a change: the next command is judged by it."""
        wait_until(lambda: condition() or not self._connection.ready, SHOWN_S, self._clock)

    def _see_newer(self, time_ns: int) -> None:
        """Let the image be one that was read after ``time_ns``."""
        self._see(lambda: self.image.stamp_ns > time_ns)


def _numbers(profile: Profile) -> tuple[float, float, float]:
    return profile.velocity, profile.acceleration, profile.deceleration


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
