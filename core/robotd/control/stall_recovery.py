"""Recovery of streamed setpoints after periods in which none was sent."""

from __future__ import annotations

from collections import deque

import numpy as np

from robotd.arrays import BoolArray, FloatArray
from robotd.clock import NANOSECONDS
from robotd.device.state import Underrun
from robotd.motion import JointLimits, MotionState

UNDERRUN_PERIODS = 1.5  # between two setpoints; more is an underrun
CATCH_UP_VELOCITY_SHARE = 0.1  # of a joint's velocity limit: highest speed relative to the path
TIME_CONSTANT_S = 0.05  # of the deviation's end
MAX_CATCH_UP_S = 0.5  # a larger deviation ends the goal
UNLIMITED_VELOCITY_RAD_S = 10.0  # stands for an infinite velocity limit
UNLIMITED_RAMP_S = 0.25  # to the velocity limit, where the acceleration has no limit
NEGLIGIBLE_DEVIATION = 1e-6  # rad or m
MOVING_VELOCITY_SHARE = 1e-3  # share of the velocity limit above which a path counts as moving


def after_stall(pause_s: float) -> str:
    """Return the end of a sentence about what a stall of ``pause_s`` led to."""
    return f"after a control-loop stall of {pause_s * 1e3:.0f} ms"


class StallRecovery:
    """Deviation from the path after an underrun, and its blend back to zero.

    While setpoints are missing an axis extrapolates the last one or holds it, see ``Underrun``.
    The next setpoint continues from there, in position and velocity. An axis that holds stays on
    its path, which waits for it (``note_hold``). In all other cases the deviation e from the path
    and its rate w then go to zero: w changes by at most the joint's acceleration limit, stays
    within a tenth of its velocity limit once it is there, and does not reverse a moving path.

    Everything follows from the setpoints that were sent, not from what a drive reports: its report
    is as late as the control loop, and to start from there feeds on itself under repeated stalls.

    Control-loop thread. Arrays are of shape (m,), setpoints (2, m): position and velocity.

    Args:
        start: setpoint of the joints at rest, before the first one is sent.
        start_ns: monotonic time until which they rest there.
        buffer_s: duration of the setpoints that the device holds ahead, s.

    Attributes:
        active: the present setpoint deviates from the path.
        pause_s: duration of the last underrun; ``longest_s``: of those that led to the deviation.
        left_plan: a source has left the motion that its successor was planned from.
    """

    def __init__(
        self,
        start: FloatArray,
        start_ns: int,
        limits: JointLimits,
        underrun: Underrun,
        buffer_s: float = 0.0,
    ) -> None:
        self.active = self.left_plan = False
        self.pause_s = self.longest_s = 0.0
        self._extrapolates = underrun is Underrun.EXTRAPOLATE
        self._sent, self._sent_ns = start.copy(), start_ns
        self._sent_time_s = 0.0
        self._buffer_s = buffer_s
        self._buffered: deque[tuple[int, float, FloatArray]] = (
            deque([(start_ns, 0.0, start.copy())]) if buffer_s > 0.0 else deque()
        )
        self._deviation: FloatArray = np.zeros_like(start)  # of the last setpoint that was sent
        self._next: FloatArray = np.zeros_like(start)  # of the one that is not sent yet
        velocity = np.minimum(limits.velocity, UNLIMITED_VELOCITY_RAD_S)
        self._moving = MOVING_VELOCITY_SHARE * velocity
        self._fastest: FloatArray = CATCH_UP_VELOCITY_SHARE * velocity
        self._acceleration = np.minimum(limits.acceleration, velocity / UNLIMITED_RAMP_S)
        self._time_constant_s = np.maximum(
            TIME_CONSTANT_S, 2.0 * self._fastest / self._acceleration
        )

    @property
    def offset(self) -> FloatArray:
        """(m,) distance from the path of the present setpoint, rad or m."""
        offset: FloatArray = self._next[0]
        return offset

    @property
    def is_far(self) -> BoolArray:
        """(m,) joints that cannot be led back within ``MAX_CATCH_UP_S``."""
        far: BoolArray = np.abs(self.offset) > MAX_CATCH_UP_S * self._fastest
        return far

    def expect(self, time_ns: int, out: FloatArray) -> float:
        """Write the command that the device has at ``time_ns`` into ``out`` (2, m).

        Returns the trajectory time of that command.
        """
        if self._buffered:
            time_s, out[:] = self._of_buffer(time_ns - round(self._buffer_s * NANOSECONDS))
            return time_s
        out[:] = self._sent
        elapsed_s = (time_ns - self._sent_ns) / NANOSECONDS
        if elapsed_s > 0.0:
            self._continue(elapsed_s, out)
        holds = elapsed_s > 0.0 and not self._extrapolates
        return self._sent_time_s if holds else self._sent_time_s + elapsed_s

    def begin_path(self, start_ns: int) -> None:
        """Count trajectory time from ``start_ns``: a successor continues from here."""
        self._sent_time_s = (self._sent_ns - start_ns) / NANOSECONDS
        self._buffered = deque(
            (due_ns, (due_ns - start_ns) / NANOSECONDS, setpoint)
            for due_ns, _, setpoint in self._buffered
        )

    def deviate(self, start: MotionState) -> None:
        """Begin with the deviation of the last setpoint from a path that begins with ``start``.

        After ``begin_path``. Before its start, a fraction of a period, the path is a straight line.
        """
        position = start.position + self._sent_time_s * start.velocity
        self._deviation[:] = self._sent - (position, start.velocity)
        self._next[:] = self._deviation
        self.active, self.left_plan = True, False

    def correct(self, path: FloatArray, due_ns: int, period_s: float) -> bool:
        """Turn the path's setpoint for ``due_ns`` into the one to send, in place.

        Returns True when an underrun was found: ``is_far`` then says whether it is too long.
        """
        elapsed_s = (due_ns - self._sent_ns) / NANOSECONDS
        underrun = self._is_underrun(elapsed_s, period_s)
        if underrun:
            self.pause_s = elapsed_s - period_s
            self.longest_s = max(self.pause_s, self.longest_s if self.active else 0.0)
            self.active = True
            self._next[:] = self._sent
            self._continue(elapsed_s, self._next)
            self._next -= path
        elif self.active:
            self._fade(path[1], elapsed_s)
        else:
            return False
        path += self._next
        return underrun

    def note_hold(self, due_ns: int, period_ns: int) -> bool:
        """Note that the device has held the last setpoint, on the path, in an underrun.

        Returns False, without effect, when there was none or the device extrapolates. Otherwise
        the path waits: its next setpoint is that of a period later, due at ``due_ns``.
        """
        elapsed_s, period_s = (due_ns - self._sent_ns) / NANOSECONDS, period_ns / NANOSECONDS
        if self._extrapolates or not self._is_underrun(elapsed_s, period_s):
            return False
        self.pause_s = elapsed_s - period_s
        self.accept()
        self._sent[1], self._sent_ns = 0.0, due_ns - period_ns
        return True

    def resume(self, time_ns: int, period_s: float) -> FloatArray | None:
        """Return (2, m) position and velocity of the device at ``time_ns`` after an underrun.

        For a source that continues from there and keeps no deviation. None: no underrun, the
        setpoint for a period later comes in time.
        """
        elapsed_s = (time_ns - self._sent_ns) / NANOSECONDS
        if not self._is_underrun(elapsed_s + period_s, period_s):
            return None
        self.pause_s = elapsed_s
        reached = self._sent.copy()
        self._continue(elapsed_s, reached)
        return reached

    def accept(self) -> None:
        """Take the present setpoint as the path: a source continues from there."""
        self.active = self.left_plan = False
        self._next[:] = self._deviation[:] = 0.0

    def sent(self, setpoint: FloatArray, due_ns: int, time_s: float = 0.0) -> None:
        """Note that ``setpoint``, made by ``correct``, has been handed to the device.

        ``time_s`` is its trajectory time, for sources that have one.
        """
        self._sent[:], self._sent_ns, self._sent_time_s = setpoint, due_ns, time_s
        self._deviation[:] = self._next
        if self._buffered:
            self._buffered.append((due_ns, time_s, setpoint.copy()))

    def _is_underrun(self, elapsed_s: float, period_s: float) -> bool:
        return elapsed_s > UNDERRUN_PERIODS * period_s + self._buffer_s

    def _of_buffer(self, time_ns: int) -> tuple[float, FloatArray]:
        """The last setpoint that was due by ``time_ns``, and its time; older ones are forgotten."""
        while len(self._buffered) > 1 and self._buffered[1][0] <= time_ns:
            self._buffered.popleft()
        return self._buffered[0][1:]

    def _continue(self, seconds: float, setpoint: FloatArray) -> None:
        if self._extrapolates:
            setpoint[0] += setpoint[1] * seconds
        else:
            setpoint[1] = 0.0

    def _fade(self, path_velocity: FloatArray, elapsed_s: float) -> None:
        """Advance from the deviation of the last setpoint that was sent."""
        offset, rate = self._deviation
        back = np.clip(-offset / self._time_constant_s, -self._fastest, self._fastest)
        speed = np.abs(path_velocity)
        reversing = (back * path_velocity < 0.0) & (speed > self._moving)
        back = np.where(reversing, np.clip(back, -speed, speed), back)
        step = self._acceleration * elapsed_s
        new_rate = rate + np.clip(back - rate, -step, step)
        self._next[0] = offset + 0.5 * (rate + new_rate) * elapsed_s
        self._next[1] = new_rate
        if (
            np.abs(self._next[0]).max() < NEGLIGIBLE_DEVIATION
            and np.abs(new_rate).max() < self._moving.min()
        ):
            self.active = False
            self._next[:] = 0.0
