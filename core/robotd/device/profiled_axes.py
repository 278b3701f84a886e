"""Axis driver for controllers that take position targets and make no profiles of their own."""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import partial

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

MAX_PAUSE_PERIODS = 2  # between two targets; in a longer one axes come to rest at the last
FEEDBACK_TIMEOUT_S = 0.2
Plan = Callable[[float, float], list[Segment]]  # from position and velocity
_TAKES_MOVES = (Operation.IDLE, Operation.POSITION, Operation.VELOCITY)


class ProfiledAxes(AxisDriver):
    """Base of an axis driver that sends position targets, one set per control period.

    Moves, velocity commands and stops are computed here, by trapezoidal profiles, in the
    control-loop thread; streamed setpoints pass through. A subclass implements
    ``read_feedback``, ``send_targets``, ``servo`` and ``clear_alarm``. It may declare
    VELOCITY_MODE, and HAND_GUIDING where it implements ``let_go``, ``catch`` and ``is_let_go``.
    While the control loop pauses, axes hold their last target; from there profiles begin anew, and
    streamed velocities are approached by ``stop_deceleration``. An axis that
    ``ProcessImage.silent`` names holds likewise, at the ``position_command`` that ``read_feedback``
    gives it: the target that its drive has. Axes that moved when values were lost hold where they
    are found. A profile advances by one period with each set of targets,
    however late it is, and has ended when values have come that were measured ``response_s`` after
    its last target was sent.

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
        self._read_ns = self._sent_ns = 0
        self._streamed = False
        self._rate = 1.0  # part of streamed velocities that is reached; below 1 after a pause

    @abstractmethod
    def read_feedback(self, image: ProcessImage) -> None:
        """Fill what the controller reports, and ``fresh_ns``. Control-loop thread; never blocks.

        That is: position, velocity, torque, servo_on, offline, alarms, switches and home_done; of
        drives that may miss targets ``silent``, and the ``position_command`` that a silent one has.
        One that is silent in the period in which it comes on, or is back, begins at that.
        """

    @abstractmethod
    def send_targets(self, positions: FloatArray) -> None:
        """Send targets (n_axes,), rad or m, due one period later. Control-loop thread.

        Called in each period in which a servo is on; must not block. The target of an axis whose
        servo is off is its measured position, NaN where that is not known.
        """

    def let_go(self, axes: Sequence[int], timeout_s: float) -> None:
        """Let ``axes`` be moved by hand, all or none; wait until they can be (HAND_GUIDING).

        From then on ``send_targets`` has their measured positions, as of axes that are off.
        """
        raise Unsupported("hand guiding")

    def catch(self, axes: Sequence[int]) -> None:
        """Begin to hold ``axes``, which were let go, where they come to rest. Returns at once.

        Called once for each axis, by any thread.
        """
        raise Unsupported("hand guiding")

    def is_let_go(self, axis: int) -> bool:
        """Return whether ``axis`` was let go, and is not held or off yet. Control-loop thread."""
        return False

    @property
    def underrun(self) -> Underrun:
        return Underrun.HOLD

    def read(self, image: ProcessImage) -> None:
        is_new = not image.fresh_ns  # communication has begun
        self.read_feedback(image)
        now_ns, response_ns = self.clock.now_ns(), round(self.response_s * NANOSECONDS)
        with self._lock:
            self._note_pause(now_ns)
            lost = now_ns - image.fresh_ns > self._feedback_lost_s * NANOSECONDS
            self._read_ns = now_ns
            # Lists: a number of an array takes several times longer to read or write by itself.
            position, commanded = image.position.tolist(), image.position_command.tolist()
            on, silent = image.servo_on.tolist(), image.silent.tolist()
            faulty = (image.amp_alarm | image.offline).tolist()
            for axis, motion in enumerate(self._motions):
                enabled = on[axis] and not faulty[axis]
                in_time = self._streamed and not (is_new or lost or silent[axis])
                if in_time and enabled and motion.streams:
                    continue  # its target is the setpoint
                if is_new:  # the controller may have kept the servo on, but no command
                    motion.enabled = False
                if motion.guided and not self._goes_on_guiding(axis, motion, image, is_new):
                    motion.end_guiding()
                if motion.guided:
                    continue
                motion.end_profile(image.fresh_ns - response_ns)
                motion.track(position[axis], enabled=enabled, lost=lost)
                if motion.operation is Operation.STREAM and not self._streamed:
                    self._hold(motion)  # a setpoint is late: its target is held
                if lost and motion.operation is not Operation.STOPPING:
                    motion.brake(self._quick_stop_deceleration)
                if silent[axis]:
                    # Until its drive answers it keeps the command that it has.
                    self._hold(motion, commanded[axis])
                    motion.strayed = motion.strayed and lost  # where it is held is known
                else:
                    motion.advance(self._period_s, now_ns)
            streams = self._show(image) and self._streamed
        self._streamed = False
        if True in on and not streams:
            self._send(now_ns)

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        now_ns = self.clock.now_ns()
        with self._lock:
            self._note_pause(now_ns)
            followers = [
                (axis, motion)
                for axis, motion in enumerate(self._motions)
                if motion.operation is Operation.STREAM
            ]
            positions, velocities = position.tolist(), velocity.tolist()
            self._speed_up([velocities[axis] for axis, motion in followers if motion.rolls])
            for axis, motion in followers:
                motion.setpoint(positions[axis], velocities[axis], self._rate, self._period_s)
                self._targets[axis] = motion.position
        self._streamed = bool(followers)
        if followers:  # else ``read`` has sent the targets of this period
            self._send(now_ns)

    def begin_guiding(self, axes: Sequence[int], timeout_s: float) -> None:
        with self._lock:
            for axis in axes:
                if self._require(axis).operation is not Operation.IDLE:
                    raise NotReady("it is not idle", axis=axis)
        self.let_go(axes, timeout_s)
        with self._lock:
            for axis in axes:
                self._motions[axis].begin(Operation.GUIDING)
                self._motions[axis].guided = True

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
            plan = partial(
                profile_to_position, target=target, profile=profile, max_deceleration=hardest
            )
            motion.begin(Operation.POSITION, plan, profile.deceleration)

    def jog(self, axis: int, profile: Profile) -> None:
        with self._lock:
            motion = self._require(axis)
            plan = partial(
                profile_to_velocity,
                target=profile.velocity,
                acceleration=profile.acceleration,
                deceleration=profile.deceleration,
            )
            motion.begin(Operation.VELOCITY, plan, profile.deceleration)

    def stop(self, axes: Sequence[int]) -> None:
        with self._lock:
            self._catch(axes)
            for axis in axes:
                motion = self._motions[axis]
                if motion.operation is not Operation.STOPPING:
                    motion.brake(motion.deceleration or self._stop_deceleration)

    def quick_stop(self, axes: Sequence[int]) -> None:
        with self._lock:
            self._catch(axes)
            for axis in axes:
                motion = self._motions[axis]
                motion.brake(max(motion.deceleration, self._quick_stop_deceleration))

    def set_command_mode(self, axis: int, mode: CommandMode) -> None:
        if mode is CommandMode.TORQUE:
            raise Unsupported("torque mode")
        with self._lock:
            self._motions[axis].mode = mode

    def _catch(self, axes: Sequence[int]) -> None:
        """Begin to hold those of ``axes`` that are guided. Lock held."""
        guided = [axis for axis in axes if self._motions[axis].operation is Operation.GUIDING]
        if guided:
            self.catch(guided)
        for axis in guided:
            self._motions[axis].operation = Operation.STOPPING

    def _goes_on_guiding(
        self, axis: int, motion: _AxisMotion, image: ProcessImage, is_new: bool
    ) -> bool:
        """Track an axis that was let go; return False once it is held, off or lost. Lock held."""
        motion.position, motion.velocity = float(image.position[axis]), 0.0
        faulty = image.amp_alarm[axis] or image.offline[axis]
        return not (is_new or faulty) and self.is_let_go(axis)

    def _send(self, now_ns: int) -> None:
        self._sent_ns = now_ns
        self.send_targets(self._targets)

    def _note_pause(self, now_ns: int) -> None:
        """Hold all axes after a pause, in which they have come to rest. Lock held."""
        if now_ns - self._sent_ns > MAX_PAUSE_PERIODS * self._period_s * NANOSECONDS:
            for motion in self._motions:
                self._hold(motion)

    def _hold(self, motion: _AxisMotion, position: float | None = None) -> None:
        """The axis has come to rest at ``position``; None: at its last target. Lock held."""
        moved = position is not None and position != motion.position
        if position is not None:
            motion.position = position
        if motion.velocity or moved:
            motion.hold()
            if motion.operation is Operation.STREAM and motion.rolls:
                self._rate = 0.0

    def _speed_up(self, velocities: Sequence[float]) -> None:
        """Raise the part of ``velocities`` that is reached, one for all: a base keeps its arc."""
        step = self._stop_deceleration * self._period_s
        fastest = max(map(abs, velocities), default=0.0)
        self._rate = min(1.0, self._rate + step / fastest) if fastest > step else 1.0

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

    def _show(self, image: ProcessImage) -> bool:
        """Show commands and states; return True while an axis streams. Lock held."""
        motions = self._motions
        operations = [motion.operation for motion in motions]
        self._targets[:] = image.position_command[:] = [motion.position for motion in motions]
        image.velocity_command[:] = [motion.velocity for motion in motions]
        image.operation[:] = operations
        image.mode[:] = [motion.mode for motion in motions]
        image.motion_complete[:] = [motion.complete for motion in motions]
        return Operation.STREAM in operations


class _AxisMotion:
    """Command of one axis: its profile, and the state that it has reached. Lock held."""

    def __init__(self) -> None:
        self.position = self.velocity = 0.0
        self.enabled = False
        self.strayed = False  # values were lost in motion
        self.mode = CommandMode.POSITION
        self.operation = Operation.IDLE
        self.guided = False  # it was let go, and is not held again yet
        self.complete = False
        self.deceleration = 0.0  # of the running command; 0: it has none
        self._plan: Plan | None = None
        self._segments: list[Segment] = []
        self._elapsed_s = 0.0
        self._ended_ns = 0  # when its last target was sent; 0: it goes on, or there is none

    @property
    def rolls(self) -> bool:
        """True while the axis follows velocities."""
        return self.mode is CommandMode.VELOCITY

    @property
    def streams(self) -> bool:
        """True while the axis is enabled and follows setpoints."""
        return self.operation is Operation.STREAM and self.enabled and not self.guided

    def begin(
        self, operation: Operation, plan: Plan | None = None, deceleration: float = 0.0
    ) -> None:
        self.operation, self.complete = operation, False
        self.deceleration, self._plan = deceleration, plan
        self._segments = plan(self.position, self.velocity) if plan else []
        self._elapsed_s, self._ended_ns = 0.0, 0

    def end_guiding(self) -> None:
        """The axis is held where it is by now, or off: its command begins at the position."""
        self.begin(Operation.IDLE)
        self.guided = self.enabled = False

    def hold(self) -> None:
        """Continue from rest at the present target."""
        self.velocity = 0.0
        self.begin(self.operation, self._plan, self.deceleration)

    def track(self, position: float, *, enabled: bool, lost: bool) -> None:
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

    def setpoint(self, position: float, velocity: float, rate: float, period_s: float) -> None:
        if self.rolls:
            velocity *= rate
            self.position += 0.5 * (self.velocity + velocity) * period_s
        else:
            self.position = position
        self.velocity = velocity

    def end_stream(self, deceleration: float) -> None:
        if self.operation is not Operation.STREAM:
            return
        if self.rolls and self.velocity:
            self.brake(deceleration)
        else:
            self.begin(Operation.IDLE)
            self.velocity, self.complete = 0.0, self.mode is CommandMode.POSITION

    def brake(self, deceleration: float) -> None:
        if self.operation is not Operation.IDLE and not self.guided:
            plan = partial(profile_to_rest, deceleration=deceleration)
            self.begin(Operation.STOPPING, plan, deceleration)

    def advance(self, step_s: float, now_ns: int) -> None:
        """Continue the profile by ``step_s``; its target is sent at ``now_ns``."""
        if not self._segments or self._ended_ns:
            return
        self._elapsed_s += step_s
        while len(self._segments) > 1 and self._segments[1].start_s <= self._elapsed_s:
            del self._segments[0]
        self.position, self.velocity = self._segments[0].at(self._elapsed_s)
        if len(self._segments) == 1 and self.velocity == 0.0 and not self._segments[0].acceleration:
            self._ended_ns = now_ns

    def end_profile(self, executed_ns: int) -> None:
        """Become idle if the values show what targets sent until ``executed_ns`` have led to."""
        if self._ended_ns and executed_ns > self._ended_ns:
            arrived = self.operation is Operation.POSITION
            self.begin(Operation.IDLE)
            self.complete = arrived
