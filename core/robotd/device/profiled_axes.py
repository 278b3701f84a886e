"""Axis driver for controllers that take position targets and make no profiles of their own."""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, Clock
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, Operation, Underrun
from robotd.errors import NotReady, Unsupported
from robotd.motion.profile import (
    Profile,
    Segment,
    profile_to_position,
    profile_to_rest,
    profile_to_velocity,
)

MAX_STEP_PERIODS = 2  # periods; after a longer pause a profile continues where it stopped
FEEDBACK_TIMEOUT_S = 0.2
_STREAM = int(Operation.STREAM)
_TAKES_MOVES = (Operation.IDLE, Operation.POSITION, Operation.VELOCITY)


class ProfiledAxes(AxisDriver):
    """Base of an axis driver that sends position targets, one set per control period.

    Moves, velocity commands and stops are computed here, by trapezoidal profiles, in the
    control-loop thread; streamed setpoints pass through. A subclass implements
    ``read_feedback``, ``send_targets``, ``servo`` and ``clear_alarm``. It may declare
    VELOCITY_MODE. While the control loop pauses, axes hold their last target. Axes that moved when
    values were lost hold where they are found: nobody knows which targets arrived.

    Args:
        axes: number of axes.
        period_s: control period, ``1 / context.robot.cycle.rate_hz``.
        clock: ``context.clock``.
        stop_deceleration: ramp of a stop that no command gave one, rad/s² or m/s².
        quick_stop_deceleration: ramp of a quick stop, same unit.
        feedback_lost_s: age of the values at which all motion is stopped.
    """

    def __init__(
        self,
        axes: int,
        period_s: float,
        clock: Clock,
        stop_deceleration: float = 5.0,
        quick_stop_deceleration: float = 20.0,
        feedback_lost_s: float = FEEDBACK_TIMEOUT_S,
    ) -> None:
        self.clock, self._period_s = clock, period_s
        self._stop_deceleration = stop_deceleration
        self._quick_stop_deceleration = quick_stop_deceleration
        self._feedback_lost_s = feedback_lost_s
        self._lock = threading.Lock()
        self._motions = [_AxisMotion() for _ in range(axes)]
        self._targets: FloatArray = np.full(axes, np.nan)
        self._read_ns = 0
        self._streamed = False

    @abstractmethod
    def read_feedback(self, image: ProcessImage) -> None:
        """Fill what the controller reports, and ``fresh_ns``. Control-loop thread; never blocks.

        That is: position, velocity, torque, servo_on, offline, alarms, switches and home_done.
        """

    @abstractmethod
    def send_targets(self, positions: FloatArray) -> None:
        """Send targets (n_axes,), rad or m, due one period later. Control-loop thread.

        Called in each period in which a servo is on; must not block. The target of an axis whose
        servo is off is its measured position, NaN where that is not known.
        """

    @property
    def underrun(self) -> Underrun:
        return Underrun.HOLD

    def read(self, image: ProcessImage) -> None:
        is_new = not image.fresh_ns  # communication has begun
        self.read_feedback(image)
        now_ns = self.clock.now_ns()
        with self._lock:
            step_s = min((now_ns - self._read_ns) / NANOSECONDS, MAX_STEP_PERIODS * self._period_s)
            lost = now_ns - image.fresh_ns > self._feedback_lost_s * NANOSECONDS
            self._read_ns = now_ns
            for axis, motion in enumerate(self._motions):
                faulty = image.amp_alarm[axis] or image.offline[axis]
                enabled = bool(image.servo_on[axis] and not faulty)
                if is_new:  # the controller may have kept the servo on, but no command
                    motion.enabled = False
                motion.follow(float(image.position[axis]), enabled=enabled, lost=lost)
                if motion.operation is Operation.STREAM and not self._streamed:
                    motion.velocity = 0.0  # a setpoint is late: its target is held
                if lost and motion.operation is not Operation.STOPPING:
                    motion.brake(self._quick_stop_deceleration)
                motion.advance(step_s)
                self._show(axis, motion, image)
        streams = (image.operation == _STREAM).any() and self._streamed
        self._streamed = False
        if image.servo_on.any() and not streams:
            self.send_targets(self._targets)

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        streams = False
        with self._lock:
            for axis, motion in enumerate(self._motions):
                if motion.operation is Operation.STREAM:
                    streams = True
                    motion.setpoint(float(position[axis]), float(velocity[axis]), self._period_s)
                    self._targets[axis] = motion.position
        self._streamed = streams
        if streams:  # else ``read`` has sent the targets of this period
            self.send_targets(self._targets)

    def begin_stream(self, axes: Sequence[int]) -> None:
        with self._lock:
            for axis in axes:
                self._require(axis)
            for axis in axes:
                self._motions[axis].begin(Operation.STREAM)

    def end_stream(self, axes: Sequence[int]) -> None:
        with self._lock:
            for axis in axes:
                self._motions[axis].end_stream(self._stop_deceleration)

    def move(self, axis: int, target: float, profile: Profile) -> None:
        with self._lock:
            motion = self._require(axis)
            hardest = max(profile.deceleration, self._quick_stop_deceleration)
            segments = profile_to_position(
                motion.position, motion.velocity, target, profile, hardest
            )
            motion.begin(Operation.POSITION, segments, profile.deceleration)

    def jog(self, axis: int, profile: Profile) -> None:
        with self._lock:
            motion = self._require(axis)
            segments = profile_to_velocity(
                motion.position,
                motion.velocity,
                profile.velocity,
                profile.acceleration,
                profile.deceleration,
            )
            motion.begin(Operation.VELOCITY, segments, profile.deceleration)

    def stop(self, axes: Sequence[int]) -> None:
        with self._lock:
            for axis in axes:
                motion = self._motions[axis]
                if motion.operation is not Operation.STOPPING:
                    motion.brake(motion.deceleration or self._stop_deceleration)

    def quick_stop(self, axes: Sequence[int]) -> None:
        with self._lock:
            for axis in axes:
                motion = self._motions[axis]
                motion.brake(max(motion.deceleration, self._quick_stop_deceleration))

    def set_command_mode(self, axis: int, mode: CommandMode) -> None:
        if mode is CommandMode.TORQUE:
            raise Unsupported("torque mode")
        with self._lock:
            self._motions[axis].mode = mode

    def _require(self, axis: int) -> _AxisMotion:
        motion = self._motions[axis]
        unread_s = (self.clock.now_ns() - self._read_ns) / NANOSECONDS
        if motion.strayed or unread_s > self._feedback_lost_s:
            raise NotReady("no values arrive", axis=axis)
        if not motion.enabled:
            raise NotReady("the servo is off, or the drive is in alarm or offline", axis=axis)
        if motion.operation not in _TAKES_MOVES:
            busy = motion.operation.name.lower()
            raise NotReady(f"takes no command while it is {busy}", axis=axis)
        return motion

    def _show(self, axis: int, motion: _AxisMotion, image: ProcessImage) -> None:
        self._targets[axis] = motion.position
        image.position_command[axis] = motion.position
        image.velocity_command[axis] = motion.velocity
        image.operation[axis] = motion.operation
        image.mode[axis] = motion.mode
        image.motion_complete[axis] = motion.complete


class _AxisMotion:
    """Command of one axis: its profile, and the state that it has reached. Lock held."""

    def __init__(self) -> None:
        self.position = self.velocity = 0.0
        self.enabled = False
        self.strayed = False  # values were lost in motion
        self.mode = CommandMode.POSITION
        self.operation = Operation.IDLE
        self.complete = False
        self.deceleration = 0.0  # of the running command; 0: it has none
        self._segments: list[Segment] = []
        self._elapsed_s = 0.0

    def begin(
        self, operation: Operation, segments: Sequence[Segment] = (), deceleration: float = 0.0
    ) -> None:
        self.operation, self.complete = operation, False
        self.deceleration = deceleration
        self._segments, self._elapsed_s = list(segments), 0.0

    def follow(self, position: float, *, enabled: bool, lost: bool) -> None:
        """Track the measured position while disabled, so that enabling makes no jump.

        Where values were lost in motion, it is taken once as well, at rest. An axis that rested
        keeps its command, which has arrived before: else its load would sink with each loss.
        """
        moves = self.operation is not Operation.IDLE
        self.strayed = self.strayed or (lost and moves)
        found = self.strayed and not lost and not moves
        if found or not (enabled and self.enabled):
            if moves:
                self.begin(Operation.IDLE)
            self.position, self.velocity, self.strayed = position, 0.0, False
        self.enabled = enabled

    def setpoint(self, position: float, velocity: float, period_s: float) -> None:
        if self.mode is CommandMode.VELOCITY:
            self.position += 0.5 * (self.velocity + velocity) * period_s
        else:
            self.position = position
        self.velocity = velocity

    def end_stream(self, deceleration: float) -> None:
        if self.operation is not Operation.STREAM:
            return
        if self.mode is CommandMode.VELOCITY and self.velocity:
            self.brake(deceleration)
        else:
            self.begin(Operation.IDLE)
            self.velocity, self.complete = 0.0, self.mode is CommandMode.POSITION

    def brake(self, deceleration: float) -> None:
        if self.operation is not Operation.IDLE:
            segments = profile_to_rest(self.position, self.velocity, deceleration)
            self.begin(Operation.STOPPING, segments, deceleration)

    def advance(self, step_s: float) -> None:
        """Continue the profile by ``step_s``."""
        if not self._segments:
            return
        self._elapsed_s += step_s
        while len(self._segments) > 1 and self._segments[1].start_s <= self._elapsed_s:
            del self._segments[0]
        self.position, self.velocity = self._segments[0].at(self._elapsed_s)
        if len(self._segments) == 1 and self.velocity == 0.0 and not self._segments[0].acceleration:
            arrived = self.operation is Operation.POSITION
            self.begin(Operation.IDLE)
            self.complete = arrived
