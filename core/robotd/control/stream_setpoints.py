"""Setpoints of a stream: the last command of its client, followed within the limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.motion import JointLimits, MotionState
from robotd.motion.limiter import SetpointLimiter
from robotd.motion.sliding_window import SlidingWindow
from robotd.motion.target_spline import TargetSpline


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
    """

    position: FloatArray | None
    velocity: FloatArray | None
    time_ns: int
    window: PointWindow | None = None


class StreamSetpoints:
    """Follows commands in a mode. One thread; arrays of shape (m,).

    Args:
        limits: of the joints.
        mode: of commands without a velocity.
        period_s: of the control loop.
    """

    def __init__(self, limits: JointLimits, mode: StreamMode, period_s: float) -> None:
        self._limiter = SetpointLimiter(limits, period_s)
        self._mode, self._period_s = mode, period_s
        self._command: StreamCommand | None = None
        self._spline: TargetSpline | None = None
        self._window: SlidingWindow | None = None
        self._velocity_limit = limits.velocity

    @property
    def at_rest(self) -> bool:
        """No setpoint moves."""
        return self._limiter.at_rest

    def reset(self, state: MotionState, strongest: float = np.inf) -> None:
        """Continue from ``state``, towards the target of the last command.

        ``strongest`` is that of ``SetpointLimiter.reset``.
        """
        self._limiter.reset(state, strongest)
        if self._command is not None and self._spline is None and self._window is None:
            self._go(self._command)

    def follow(self, command: StreamCommand) -> None:
        """Take a command, at once or on the curve."""
        self._command = command
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
        """Slow to rest in minimal time, and forget the last command."""
        self._command = self._spline = self._window = None
        self._limiter.stop()

    def settle(self) -> None:
        """Move to rest on a fixed plan, at the newest position target if any."""
        command = self._command
        if command is None or command.position is None:
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
        if self._spline is not None:
            reference = self._spline.advance(self._period_s)
            return self._limiter.track(reference, self._spline.newest, self._spline.stands)
        if (window := self._window) is not None:
            reference = window.at(due_ns)
            velocities = window.velocity_range(
                reference, self._limiter.state[0], self._velocity_limit
            )
            return self._limiter.track(reference, window.newest, window.stands, velocities)
        command = self._command
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
