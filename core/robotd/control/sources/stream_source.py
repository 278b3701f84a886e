"""Setpoint source that follows the commands of a stream while they arrive."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, NamedTuple, Protocol

import numpy as np

from robotd.arrays import BoolArray, FloatArray, IntArray
from robotd.clock import NANOSECONDS
from robotd.control.loop.setpoint_source import Outcome, SetpointSource
from robotd.control.loop.stall_recovery import StallRecovery
from robotd.control.sources.joint_source import JointSource, SourcePhase
from robotd.device.axes import Axes
from robotd.device.motion_limits import MotionLimits
from robotd.device.process_image import ProcessImage
from robotd.log import get_logger
from robotd.motion import JointLimits, MotionState
from robotd.motion.limiter import SetpointLimiter
from robotd.motion.sliding_window import SlidingWindow
from robotd.motion.target_spline import TargetSpline

log = get_logger("stream")

SPEED_LIMIT_LOOKAHEAD_S = 0.03  # in which a limit of speed may fall while an acceleration ramps up
REFERENCE_STOP_TIMEOUT_S = 1.0  # then a reference that still moves is left, and the joints stop
MAX_QUEUED_COMMANDS = 16  # commands in one period; older ones are dropped
MAX_ACCELERATION_SHARE_AFTER_STALL = 2.0  # of the limits; a drive cannot follow any


class MovingReference(Protocol):
    """Motion of all m joints of a group, decided anew in each control period.

    Its methods are called by the control loop, one at a time: they never block, and take a small
    part of a period. The joints follow it within their limits, whatever it returns; they follow it
    exactly while it keeps within 0.9 of the limits of velocity and acceleration and within that of
    the jerk. It keeps the ``MotionLimits`` of the group by itself. A reference that raises is left:
    the joints stop, and the stream ends with a fault.
    """

    def begin(self, setpoint: FloatArray, limits: JointLimits, period_s: float) -> None:
        """Start from ``setpoint`` (3, m): position, velocity and acceleration.

        Called before the first command, when the joints are at rest, and where its own motion was
        interrupted.
        """

    def take(self, command: Any) -> None:
        """Follow a command that the client sent."""

    def stop(self) -> None:
        """Slow to rest, as quickly as its own limits allow, until the next command."""

    def advance(self) -> FloatArray:
        """Return (3, m) for the end of the next period; without acceleration changes in it."""


class StreamMode(StrEnum):
    """Interpolation between the targets of a stream."""

    TARGET = "target"  # to each target in minimal time
    SMOOTH = "smooth"  # on a curve through the targets, 1.75 input periods behind them


class PointWindow(NamedTuple):
    """Points that replace those of the window before from the first on.

    Attributes:
        times_ns: (n,) increasing, on the clock of the control loop.
        position, velocity: (n, m).
    """

    times_ns: Sequence[int]
    position: FloatArray
    velocity: FloatArray


@dataclass(frozen=True, eq=False)
class StreamCommand:
    """Command of a stream's client; arrays (m,), NaN for joints that it does not command.

    Attributes:
        position: target in rad or m; None: the command is ``velocity`` alone.
        velocity: at ``position`` and after it, or to move with; None: the target stands still.
        time_ns: at which it was sent.
        window: points on the way to ``position``.
        reference: decides the motion, by ``value``; None: the command is one of the above.
        value: what ``reference`` takes.
    """

    position: FloatArray | None
    velocity: FloatArray | None
    time_ns: int
    window: PointWindow | None = None
    reference: MovingReference | None = None
    value: Any = None


class StreamSetpoints:
    """Follows commands in a mode. One thread; arrays of shape (m,).

    Args:
        mode: of commands without a velocity.
        motion_limits: of the group.

    Attributes:
        failure: error of a reference that was left; "": none.
    """

    def __init__(
        self,
        limits: JointLimits,
        mode: StreamMode,
        period_s: float,
        motion_limits: MotionLimits,
    ) -> None:
        self.failure = ""
        self._motion_limits = motion_limits
        self._settles = False  # on a fixed plan, for a successor
        self._limiter, self._limits = SetpointLimiter(limits, period_s), limits
        self._mode, self._period_s = mode, period_s
        self._command: StreamCommand | None = None
        self._spline: TargetSpline | None = None
        self._window: SlidingWindow | None = None
        self._reference: MovingReference | None = None
        self._stop_left_s = np.inf  # until a stopping reference is left
        self._velocity_limit = limits.velocity
        # (2·m + 1, m) each joint alone, all others, and all.
        alone = np.eye(len(limits.names))
        self._subsets = np.concatenate([alone, 1.0 - alone, np.ones_like(alone[:1])])

    @property
    def at_rest(self) -> bool:
        """True while no setpoint moves."""
        return self._limiter.at_rest

    def reset(self, state: MotionState, strongest: float = np.inf) -> None:
        """Continue from ``state``, towards the target of the last command.

        ``strongest`` is that of ``SetpointLimiter.reset``.
        """
        self._limiter.reset(state, strongest)
        if self._reference is not None:
            self._begin(self._reference)
        elif self._command is not None and self._spline is None and self._window is None:
            self._go(self._command)

    def take(self, command: StreamCommand) -> None:
        """Take a command, at once or on the curve."""
        self._command, self._settles = command, False
        if command.reference is not None:
            self._spline = self._window = None
            if self._reference is command.reference:
                self._refer(command.reference, command.value)
            else:  # when the joints are at rest: its own stop would be longer than theirs
                self._reference = None
                self._limiter.stop()
            return
        self._reference = None
        if command.window is not None:
            self._spline = None
            if self._window is None:
                self._window = SlidingWindow(*command.window)
            else:
                self._window.replace(*command.window)
        elif self._mode is StreamMode.TARGET or command.position is None:
            self._go(command)
        elif self._spline is None:
            position, velocity, _ = self._limiter.state
            self._spline = TargetSpline(position, velocity, command.position, command.time_ns)
        else:
            self._spline.add(command.position, command.time_ns)

    def stop(self) -> None:
        """Slow to rest in minimal time, or as a reference does; forget the last command."""
        self._command = self._spline = self._window = None
        if self._reference is None:
            self._limiter.stop()
        elif self._stop_left_s == np.inf:
            self._stop_left_s = REFERENCE_STOP_TIMEOUT_S
            self._call(self._reference.stop)

    def wait_for(self, silent: BoolArray, command: FloatArray, strongest: float) -> None:
        """Slow the joints to rest, and forget the last command: some drives do not answer.

        Args:
            silent: (m,) joints of these drives, which get no setpoint.
            command: (m,) position from which each of them will continue, at rest.
            strongest: as of ``reset``, for the others.
        """
        state = self._limiter.state.copy()
        state[0, silent], state[1:, silent] = command[silent], 0.0
        self._limiter.reset(MotionState(*state), strongest)
        self._spline = self._window = None
        self._leave()

    def settle(self) -> None:
        """Move to rest on a fixed plan, at the newest position target if any."""
        command, self._settles = self._command, True
        limits = self._motion_limits
        limited = limits.factors is not None or limits.obstacle is not None
        if command is None or command.position is None or limited:
            self._reference = None
            self.stop()
        elif self._spline is not None or command.velocity is not None:
            self._command = replace(command, velocity=None, window=None)
            self._spline = self._window = None
            self._limiter.approach(command.position)

    def after(self, seconds: float) -> MotionState:
        """Return the state ``seconds`` after the last setpoint; after ``settle`` only."""
        return MotionState(*self._limiter.after(seconds))

    def advance(self, due_ns: int) -> FloatArray:
        """Return the next setpoint (3, m): position, velocity and acceleration."""
        factors, obstacle = self._motion_limits.factors, self._motion_limits.obstacle
        free = factors is None and obstacle is None
        if free or self._settles or self._reference is not None:
            return self._next(due_ns)
        before = self._limiter.state.copy()
        state = self._next(due_ns)
        if factors is not None:
            peak = self._limiter.peak_velocity()
            # Some joints are at rest before others, whose motion they no longer compensate then.
            parts = np.concatenate([peak * self._subsets, [peak]])
            ahead = state[0] + SPEED_LIMIT_LOOKAHEAD_S * parts
            ahead[-1] = state[0]
            factor = float(factors(ahead, parts).min())
            if factor < 1.0:
                state = self._limiter.slow_down(before, factor * peak)
        if obstacle is None or self._command is None:
            return state
        if obstacle(before[0], self._limiter.stop_positions()):
            self.stop()
            self._limiter.reset(MotionState(*before))
            return self._limiter.step()
        return state

    def _next(self, due_ns: int) -> FloatArray:
        """Return the next setpoint without the limits of the group."""
        command = self._command
        if self._reference is None and command is not None and command.reference is not None:
            if not self.at_rest:
                return self._limiter.step()
            self._refer(command.reference, command.value)
        if self._reference is not None:
            return self._track(self._reference)
        if self._spline is not None:
            reference = self._spline.advance(self._period_s)
            return self._limiter.track(reference, self._spline.newest, self._spline.rests)
        if (window := self._window) is not None:
            reference = window.at(due_ns)
            velocities = window.velocity_range(
                reference, self._limiter.state[0], self._velocity_limit
            )
            return self._limiter.track(reference, window.newest, window.rests, velocities)
        if command is None or command.position is None or command.velocity is None:
            return self._limiter.step()
        age_s, velocity = (due_ns - command.time_ns) / NANOSECONDS, command.velocity
        position = command.position + age_s * velocity
        reference = np.array([position, velocity, np.zeros_like(velocity)])
        return self._limiter.track(reference, position.tolist(), (velocity == 0.0).tolist())

    def _go(self, command: StreamCommand) -> None:
        self._spline = self._window = None
        if command.velocity is None and command.position is not None:
            self._limiter.approach(command.position)
        elif command.velocity is not None and command.position is None:
            self._limiter.move(np.nan_to_num(command.velocity))

    def _refer(self, reference: MovingReference, value: Any) -> None:
        """Let ``reference`` take a command; a new one begins where the joints rest."""
        self._stop_left_s = np.inf
        if self._reference is not reference:
            self._begin(reference)
        self._call(lambda: reference.take(value))

    def _begin(self, reference: MovingReference) -> None:
        self._reference = reference
        setpoint = self._limiter.state.copy()
        self._call(lambda: reference.begin(setpoint, self._limits, self._period_s))

    def _track(self, reference: MovingReference) -> FloatArray:
        """Return the next setpoint on ``reference``, or on a stop where it is left."""
        self._stop_left_s -= self._period_s
        if self._stop_left_s < 0.0 and not self.at_rest:
            self._leave()
            return self._limiter.step()
        try:
            ahead = reference.advance()
            if ahead.shape != self._limiter.state.shape or not np.isfinite(ahead).all():
                raise ValueError(f"a reference returned {ahead}")  # noqa: TRY301 - fails alike
        except Exception as error:  # noqa: BLE001 - of a feature
            self._fail(error)
            return self._limiter.step()
        return self._limiter.track(ahead, ahead[0].tolist(), [False] * ahead.shape[1])

    def _call(self, method: Callable[[], None]) -> None:
        try:
            method()
        except Exception as error:  # noqa: BLE001 - of a feature
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        self.failure = f"its reference failed: {type(error).__name__}: {error}"
        log.error("a moving reference failed, the joints stop", exc_info=error)
        self._leave()

    def _leave(self) -> None:
        self._command = self._reference = None
        self._limiter.stop()


class StreamMotion(JointSource):
    """Motion of m joints towards the commands that ``put`` receives.

    Without a command for ``timeout_s`` the joints slow to rest; the next command continues, unless
    ``ends_when_silent``. While a drive does not answer the joints slow to rest, too. It ends when a
    client requests it, at standstill, or with a fault.

    Args:
        robot: axes of the robot; the stream ends at a speed of 0, because its targets cannot wait.
        axes: (m,) index of each joint's axis.
        start_ns: due time of the first setpoint, at the earliest.
        mode: interpolation between position targets.
        timeout_s: age of the last command at which the joints slow to rest.
        stopped_velocity: (m,) rad/s or m/s below which a joint is at rest.
        ends_when_silent: it ends when the joints are at rest after ``timeout_s``.

    Attributes:
        timeout_ns: age of the last command at which the joints slow to rest.
        timeouts: number of times that the joints slowed to rest without a command.
    """

    stall_recovery: StallRecovery

    def __init__(
        self,
        robot: Axes,
        axes: IntArray,
        state: MotionState,
        start_ns: int,
        *,
        limits: JointLimits,
        mode: StreamMode,
        timeout_s: float,
        period_s: float,
        stopped_velocity: FloatArray,
        motion_limits: MotionLimits,
        ends_when_silent: bool,
    ) -> None:
        setpoint = np.array([state.position, state.velocity, state.acceleration])
        super().__init__(limits, axes, start_ns, setpoint, stopped_velocity, robot.response_s)
        self.mode, self.timeouts = mode, 0
        self.stall_recovery = StallRecovery(
            setpoint[:2], start_ns, limits, robot.extrapolation_s, robot.stream_buffer_s
        )
        self._speed = robot.speed
        self._setpoints = StreamSetpoints(limits, mode, period_s, motion_limits)
        self._setpoints.reset(state)
        self.timeout_ns = round(timeout_s * NANOSECONDS)
        self._timeout_s, self._ends_when_silent = timeout_s, ends_when_silent
        self._commands: deque[StreamCommand] = deque(maxlen=MAX_QUEUED_COMMANDS)
        self._commanded_ns = start_ns
        self._silent = False
        self._due_ns = 0
        self._settled_until_ns = 0
        self._lock = threading.Lock()  # of the setpoints, against ``splice_state``

    def put(self, command: StreamCommand) -> None:
        """Follow ``command`` from the next period on; never blocks. Any thread."""
        self._commands.append(command)

    def splice_state(self, time_ns: int) -> MotionState | None:
        """Return the state at ``time_ns``, until which commands wait. Any thread."""
        with self._lock:
            if not self.completion.goes_on:
                return None
            self._settled_until_ns = max(self._settled_until_ns, time_ns)  # another may wait
            if not self._due_ns:
                return MotionState.at_rest(self.setpoint[0])
            self._setpoints.settle()
            return self._setpoints.after((time_ns - self._due_ns) / NANOSECONDS)

    def end_splice(self) -> None:
        self._settled_until_ns = 0

    def take_over(self, running: SetpointSource, advanced_ns: int, delay_ns: int) -> None:
        """Continue from the setpoint of ``running``, made in the period ``advanced_ns``."""
        self._continue(running, advanced_ns, delay_ns)
        self._setpoints.reset(MotionState(*running.setpoint))
        if running.stall_recovery is not None:
            self.stall_recovery = running.stall_recovery
            self.stall_recovery.accept()

    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> bool:
        """Compute the setpoint for ``time_ns + period_ns``; holds it after the end."""
        if self.completion.done:
            return True
        with self._lock:
            self._due_ns = time_ns + period_ns
            seconds = (time_ns - self.start_ns) / NANOSECONDS
            self._check_drives(image, seconds, self._begin_period(time_ns))
            if not self._speed.scale:
                self.completion.request(Outcome.STOPPED, f"motion is {self._speed.text}")
            reached = self.stall_recovery.resume(time_ns, period_ns / NANOSECONDS)
            if reached is not None:
                position, velocity = reached
                state = MotionState(position, velocity, np.zeros_like(position))
                self._setpoints.reset(state, MAX_ACCELERATION_SHARE_AFTER_STALL)
                self.stall_recovery.left_plan = self._due_ns <= self._settled_until_ns
            unanswered = image.silent[self.columns]
            if np.count_nonzero(unanswered):  # a fifth of the time of ``any``
                command = image.position_command[self.columns]
                self._setpoints.wait_for(unanswered, command, MAX_ACCELERATION_SHARE_AFTER_STALL)
                self.stall_recovery.left_plan |= self._due_ns <= self._settled_until_ns
            elif self._phase is SourcePhase.RUNNING:
                self._take_commands(time_ns)
            self.setpoint[:] = self._setpoints.advance(self._due_ns)
            if self._setpoints.failure:
                self.completion.request(Outcome.FAULT, self._setpoints.failure)
            if self._phase is not SourcePhase.RUNNING and self._setpoints.at_rest:
                if self._phase is SourcePhase.STOPPING:
                    self._enter(SourcePhase.RESTING, time_ns)
                self._end_at_rest(time_ns, image)
        return True

    def sent(self, due_ns: int) -> None:
        self.stall_recovery.sent(self.setpoint[:2], due_ns)

    def _take_commands(self, time_ns: int) -> None:
        """Take new commands; slow to rest without any, or when an end was requested."""
        if self.completion.requested is None and self._due_ns > self._settled_until_ns:
            while self._commands:
                command = self._commands.popleft()
                self._setpoints.take(command)
                self._commanded_ns, self._silent = command.time_ns, False
            if time_ns - self._commanded_ns > self.timeout_ns and not self._silent:
                self._silent = True
                self.timeouts += 1
                self._setpoints.stop()
                if self._ends_when_silent:
                    self.completion.request(
                        Outcome.SUCCEEDED, f"no command for {self._timeout_s:g} s"
                    )
        if self.completion.requested is not None:
            self._setpoints.stop()
            self._enter(SourcePhase.STOPPING, time_ns)
