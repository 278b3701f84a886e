"""Setpoints of a stream: the last command of its client, followed within the limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, NamedTuple, Protocol

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.device.motion_limits import MotionLimits
from robotd.log import get_logger
from robotd.motion import JointLimits, MotionState
from robotd.motion.limiter import SetpointLimiter
from robotd.motion.sliding_window import SlidingWindow
from robotd.motion.target_spline import TargetSpline

log = get_logger("stream")

SPEED_LIMIT_LOOKAHEAD_S = 0.03  # in which a limit of speed may fall while an acceleration ramps up
REFERENCE_STOP_TIMEOUT_S = 1.0  # then a reference that still moves is left, and the joints stop


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

        Called before the first command, when the joints stand, and where its own motion was
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
        """No setpoint moves."""
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
            else:  # when the joints stand: its own stop would be longer than theirs
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
            return self._limiter.track(reference, self._spline.newest, self._spline.stands)
        if (window := self._window) is not None:
            reference = window.at(due_ns)
            velocities = window.velocity_range(
                reference, self._limiter.state[0], self._velocity_limit
            )
            return self._limiter.track(reference, window.newest, window.stands, velocities)
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
        """Let ``reference`` take a command; a new one begins where the joints stand."""
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
