"""The axis driver: commands of the engine, and how their completion is known.

Completion is never taken from ``inPos``: with the usual width of 1000 rad it is always true.
What counts is the servo's own feedback, ``opState`` and ``motionComplete``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from itertools import product

import numpy as np

from robotd.api import (
    AxisDriver,
    CommandMode,
    DeviceTimeout,
    FloatArray,
    NotReady,
    OperationError,
    ProcessImage,
    Profile,
    RobotdError,
    Underrun,
    Unsupported,
    get_logger,
    wait_until,
)
from robotd_wmx._native import CallError, Device, Snapshot
from robotd_wmx.connection import WmxConnection
from robotd_wmx.errors import text_of, translate, translated
from robotd_wmx.position_stream import PositionStream
from robotd_wmx.readout import Readout
from robotd_wmx.splines import Splines
from robotd_wmx.velocity_stream import VelocityStream

log = get_logger("wmx")

MODE_TIMEOUT_S = 1.0
STREAM_END_S = 5.0
# A spline may brake or turn by itself during the stop: both together stay near the joints' limits.
SPLINE_STOP = 1.5
BUMPLESS_UNITS = 1e-4  # command and measured position this close make no jump
POLL_S = 0.002


class WmxAxes(AxisDriver):
    """The axes 0 … n - 1 of the engine."""

    def __init__(self, connection: WmxConnection) -> None:
        self._connection = connection
        self._scaling = connection.scaling
        self._stream = VelocityStream(connection, self._slow_down)
        self._positions = PositionStream(connection)
        self._splines = Splines(connection)
        connection.before_close(self._positions.close)
        if not self._positions.available:
            connection.after_open(self._splines.allocate)
        self._readout = Readout(connection, self._stream, self._positions)
        self._jogging: set[int] = set()  # by a velocity command that no stop has ended

    def read(self, image: ProcessImage) -> None:
        self._readout.fill(image)

    @property
    def underrun(self) -> Underrun:
        return Underrun.HOLD if self._positions.available else Underrun.EXTRAPOLATE

    @property
    def stream_buffer_s(self) -> float:
        available = self._positions.available
        return self._connection.options.stream_buffer_s if available else 0.0

    @property
    def follows_trajectories(self) -> bool:
        return not self._positions.available

    @property
    def max_trajectory_points(self) -> int:
        return self._splines.max_points

    def stream_ran_dry(self, due_ns: int) -> bool:
        return self._positions.ran_dry(due_ns)

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        self._stream.put(velocity)
        self._positions.put(position, velocity, due_ns)

    def begin_stream(self, axes: Sequence[int]) -> None:
        """Without cyclic buffers: velocity mode only, see ``follow``.

        The engine would begin those that can, and abort the buffer of one that streams already.
        """
        status = self._status()
        for axis in axes:
            if not status.servo_on(axis):
                raise NotReady("streaming: the servo is off", axis=axis)
            if self._positions.stopping(axis) and not status.idle(axis):
                raise NotReady("streaming: the stream before is being stopped", axis=axis)
        axes = [axis for axis in axes if not self._streams(axis, status)]
        by_position = [axis for axis in axes if status.mode(axis) != CommandMode.VELOCITY]
        if by_position and not self._positions.available:
            raise Unsupported("streamed positions")
        if by_position:
            with translated(f"streaming positions of axes {by_position}"):
                self._positions.begin(by_position)
        if by_velocity := [axis for axis in axes if axis not in by_position]:
            self._stream.begin(by_velocity)

    def end_stream(self, axes: Sequence[int]) -> None:
        self._positions.stop(axes)
        self._slow_down(self._stream.end(axes))
        if not self._wait(lambda: not any(map(self._positions.active, axes)), STREAM_END_S):
            raise DeviceTimeout(f"streaming of axes {axes} did not end within {STREAM_END_S:g} s")

    def follow(self, axes: Sequence[int], times_s: FloatArray, positions: FloatArray) -> None:
        self._splines.start(axes, times_s, positions)

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        what = f"servo {'on' if on else 'off'}"
        with translated(what, axis=axis):
            if on:
                self._bring_command_to_position(axis)
            self._device.set_servo(axis, on)
        is_on, failure = not on, ""

        def settled() -> bool:
            nonlocal is_on, failure
            if status := self._status_or_none():
                is_on = status.servo_on(axis)
                failure = _servo_failure(status, axis) if on else ""
            return is_on == on or bool(failure)

        confirmed = self._wait(settled, timeout_s)
        if on and not is_on:
            with suppress(CallError):  # else it may come on later, by itself
                self._device.set_servo(axis, False)
        if not confirmed:
            raise DeviceTimeout(f"{what}: no confirmation within {timeout_s:g} s", axis=axis)
        if failure:
            raise OperationError(f"{what}: {failure}", axis=axis)

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        what = "clearing the alarm"
        status = self._status()
        if status.offline(axis):
            raise NotReady(f"{what}: the drive is offline", axis=axis)
        with translated(what, axis=axis):
            if status.amp_alarm(axis):
                self._device.clear_amp_alarm(axis)
            if status.following_error_alarm(axis):
                self._device.clear_axis_alarm(axis)
        if not self._wait(lambda: not _alarmed(self._status(), axis), timeout_s):
            raise DeviceTimeout(f"{what}: it is still there after {timeout_s:g} s", axis=axis)

    def set_command_mode(self, axis: int, mode: CommandMode) -> None:
        if mode is CommandMode.TORQUE:
            raise Unsupported("torque mode")
        what = f"mode {mode.name.lower()}"
        with translated(what, axis=axis):
            self._device.set_command_mode(axis, int(mode))
        if not self._wait(lambda: self._status().mode_feedback(axis) == mode, MODE_TIMEOUT_S):
            raise DeviceTimeout(f"{what}: no confirmation within {MODE_TIMEOUT_S:g} s", axis=axis)
        self._stream.rolling[axis] = False

    def set_polarity(self, axis: int, polarity: int) -> None:
        what = f"polarity {polarity}"
        self._require_off(axis, what)
        with translated(what, axis=axis):
            self._device.set_polarity(axis, polarity)

    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        what = f"gear ratio {numerator:g}/{denominator:g}"
        self._require_off(axis, what)
        with translated(what, axis=axis):
            self._device.set_gear_ratio(axis, numerator, denominator)

    def home(self, axis: int, timeout_s: float) -> None:
        with translated("homing", axis=axis):
            self._device.set_home_type_current(axis)
            self._device.start_home(axis)
        if not self._wait(lambda: self._status().idle(axis), timeout_s):
            raise DeviceTimeout(f"homing: not done within {timeout_s:g} s", axis=axis)
        if not self._status().home_done(axis):
            raise OperationError("homing: it was interrupted", axis=axis)

    def move(self, axis: int, target: float, profile: Profile) -> None:
        units = target * float(self._scaling.units[axis])
        with translated(f"move to {target:g}", axis=axis):
            self._device.start_pos(axis, units, *self._scaling.profile(axis, profile))

    def jog(self, axis: int, profile: Profile) -> None:
        if profile.velocity == 0.0:
            self._end_jog(axis, profile.deceleration)
            return
        in_velocity_mode = self._status().mode(axis) == CommandMode.VELOCITY
        start = self._device.start_vel if in_velocity_mode else self._device.start_jog
        with translated(f"velocity {profile.velocity:g}", axis=axis):
            start(axis, *self._scaling.profile(axis, profile))
        if in_velocity_mode:
            self._jogging.add(axis)
            self._stream.rolling[axis] = False

    def stop(self, axes: Sequence[int]) -> None:
        """Stop splines in the joints' own time, moves with their deceleration."""
        self._jogging.difference_update(axes)
        by_velocity = self._stream.end(axes)
        streamed = by_velocity + self._positions.stop(axes)
        others = [axis for axis in axes if axis not in streamed]
        with ExitStack() as stops:  # all of them, also where one is rejected
            stops.callback(self._slow_down, by_velocity)
            status, device = self._status_or_none(), self._device
            splined = [axis for axis in others if status and status.interpolating(axis)]
            others = [axis for axis in others if axis not in splined]
            stops.callback(self._each_mode, others, device.stop_motion, device.stop_velocity)
            if status and splined:
                duration_s = SPLINE_STOP * self._stop_s(status, splined)
                stops.callback(self.stop_trajectory, splined, duration_s)

    def stop_trajectory(self, axes: Sequence[int], duration_s: float) -> None:
        """``Motion::Stop`` would use the spline's own acceleration, however gentle that is.

        An axis whose drive has failed may refuse; the others stop all the same, and along the
        path. Where the engine refuses a timed stop for all of them, its own stop is the next best.
        """
        status = self._status_or_none()
        moving = [axis for axis in axes if not (status and status.idle(axis))]
        if not moving:
            return
        try:
            self._device.timed_stop_motion(moving, max(1.0, duration_s * 1000.0))
        except CallError as error:
            log.warning("timed stop rejected", axes=moving, reason=text_of(*error.args[1:3]))
            self._each_mode(moving, self._device.stop_motion, self._device.stop_velocity)

    def quick_stop(self, axes: Sequence[int]) -> None:
        self._jogging.difference_update(axes)
        by_velocity = self._stream.end(axes)
        streamed = by_velocity + self._positions.quick_stop(axes)
        others = [axis for axis in axes if axis not in streamed]
        with ExitStack() as stops:
            device = self._device
            for axis in by_velocity:
                stops.callback(self._end_rolling, axis, partial(device.quick_stop_velocity, [axis]))
            self._each_mode(others, device.quick_stop_motion, device.quick_stop_velocity)

    @property
    def _device(self) -> Device:
        return self._connection.command

    def _status(self) -> Snapshot:
        with translated("status"):
            return Snapshot(self._device)

    def _status_or_none(self) -> Snapshot | None:
        """None where it cannot be read: a stop needs no status."""
        try:
            return self._status()
        except RobotdError:
            return None

    def _wait(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        return wait_until(condition, timeout_s, self._connection.clock, POLL_S)

    def _bring_command_to_position(self, axis: int) -> None:
        """The engine's command follows a free axis by itself; where it does not, it must."""

        def together() -> bool:
            status = self._status()
            away = abs(status.position_command(axis) - status.position(axis))
            return status.servo_on(axis) or away <= BUMPLESS_UNITS

        if together():
            return
        self._device.command_to_feedback(axis)
        if not self._wait(together, MODE_TIMEOUT_S):
            raise OperationError(
                "the command is not at the measured position, enabling would jump", axis=axis
            )

    def _require_off(self, axis: int, what: str) -> None:
        """An enabled axis keeps its scale: the engine would change where it is."""
        if self._status().servo_on(axis):
            raise NotReady(f"{what}: the servo is on", axis=axis)

    def _streams(self, axis: int, status: Snapshot) -> bool:
        """The engine has an axis idle whose stream ended with the communication."""
        by_position = self._positions.active(axis) and not status.idle(axis)
        return by_position or bool(self._stream.active[axis])

    def _end_jog(self, axis: int, deceleration: float) -> None:
        """Slow down by ``deceleration``: the engine's stop has the ramp of the running command.

        A running stop stays as it is, for it may be the harder one.
        """
        status = self._status()
        if axis not in self._jogging or status.idle(axis):
            self.stop([axis])
            return
        self._jogging.discard(axis)
        speed = abs(status.velocity_command(axis)) * float(self._scaling.si[axis])
        milliseconds = max(1.0, speed / deceleration * 1000.0)
        self._excusing(partial(self._device.timed_stop_velocity, axis, milliseconds), [axis])

    def _slow_down(self, axes: Sequence[int]) -> None:
        """Streamed commands have no deceleration of their own: stop within |v| / deceleration.

        Where no status can be read |v| is that of the last command: a stop needs none.
        """
        seconds = np.abs(self._stream.sent) / self._scaling.stop_deceleration
        if status := self._status_or_none():
            seconds[list(axes)] = [self._stop_s(status, [axis]) for axis in axes]
        with ExitStack() as stops:
            for axis in axes:
                milliseconds = max(1.0, float(seconds[axis]) * 1000.0)
                call = partial(self._device.timed_stop_velocity, axis, milliseconds)
                stops.callback(self._end_rolling, axis, call)

    def _end_rolling(self, axis: int, stop: Callable[[], None]) -> None:
        self._excusing(stop, [axis])
        self._stream.rolling[axis] = False

    def _stop_s(self, status: Snapshot, axes: Sequence[int]) -> float:
        """The longest |v| / deceleration of ``axes``, s."""
        per_unit: list[float] = (self._scaling.si / self._scaling.stop_deceleration).tolist()
        return max(abs(status.velocity_command(axis)) * per_unit[axis] for axis in axes)

    def _each_mode(
        self,
        axes: Sequence[int],
        position: Callable[[list[int]], None],
        velocity: Callable[[list[int]], None],
    ) -> None:
        """Stop moving axes by the calls of their mode; one rejection spares none."""
        status = self._status_or_none()
        if status is None:
            self._stop_blindly(axes, position, velocity)
            return
        moving = [axis for axis in axes if not status.idle(axis)]
        with ExitStack() as stops:
            for call, mode in ((position, False), (velocity, True)):
                chosen = [a for a in moving if (status.mode(a) == CommandMode.VELOCITY) is mode]
                if chosen:
                    stops.callback(self._excusing, partial(call, chosen), chosen)

    def _stop_blindly(
        self,
        axes: Sequence[int],
        position: Callable[[list[int]], None],
        velocity: Callable[[list[int]], None],
    ) -> None:
        """Call both stops for each axis, of unknown mode: the engine rejects one of them."""
        rejected: list[CallError] = []
        for axis, call in product(axes, (position, velocity)):
            try:
                call([axis])
            except CallError as error:
                rejected.append(error)
        if len(rejected) > len(axes):
            raise translate(rejected[-1], f"stop of axes {list(axes)}") from rejected[-1]

    def _excusing(self, stop: Callable[[], None], axes: Sequence[int]) -> None:
        """Call ``stop``: it may be rejected for an axis that came to rest meanwhile."""
        try:
            stop()
        except CallError as error:
            status = self._status()
            still = [axis for axis in axes if not status.idle(axis) and status.servo_on(axis)]
            if len(still) == 1:
                raise translate(error, "stop", axis=still[0]) from error
            if still:
                raise translate(error, f"stop of axes {still}") from error


def _alarmed(status: Snapshot, axis: int) -> bool:
    return status.amp_alarm(axis) or status.following_error_alarm(axis)


def _servo_failure(status: Snapshot, axis: int) -> str:
    if status.offline(axis):
        return "the drive is offline"
    if status.amp_alarm(axis):
        return f"the drive is in alarm {status.alarm_code(axis)} (0x{status.alarm_code(axis):X})"
    if status.following_error_alarm(axis):
        return "the measured position is too far from the command (ServoOnFollowingError)"
    return ""
