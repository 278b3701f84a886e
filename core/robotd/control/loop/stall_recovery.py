"""Recovery of streamed setpoints after periods without one."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from robotd.arrays import BoolArray, FloatArray
from robotd.clock import NANOSECONDS
from robotd.motion import JointLimits, MotionState

UNDERRUN_PERIODS = 1.5  # between two setpoints; more is an underrun
CATCH_UP_VELOCITY_SHARE = 0.1  # of a joint's velocity limit: highest speed relative to the path
TIME_CONSTANT_S = 0.05  # of the deviation's end
MAX_CATCH_UP_S = 0.5  # a larger deviation ends the goal
UNLIMITED_VELOCITY_RAD_S = 10.0  # stands for an infinite velocity limit
UNLIMITED_RAMP_S = 0.25  # to the velocity limit, where the acceleration has no limit
MIN_ACCELERATION_SHARE = 0.25  # of the limit, for w where the path uses all of it by itself
NEGLIGIBLE_DEVIATION = 1e-6  # rad or m
MOVING_VELOCITY_SHARE = 1e-3  # share of the velocity limit above which a path counts as moving


def after_stall(pause_s: float) -> str:
    """Return the end of a sentence about what a stall of ``pause_s`` led to."""
    return f"after a control-loop stall of {pause_s * 1e3:.0f} ms"


class StallRecovery:
    """Deviation from the path after an underrun, and its blend back to zero.

    An axis without setpoints keeps its last velocity for at most ``extrapolation_s`` and then holds
    (``Underrun``). The first setpoint after that continues from where the axis is, in position and
    velocity, and the path waits for an axis that holds (``wait``).

    The deviation e from the path and its rate w = de/dt then return to zero. The change of w is
    limited: path and w together keep the acceleration limit of the joint; where the path alone
    uses all of it, w gets a quarter of it on top. w stays within a tenth of the velocity limit,
    except while it slows down to that, and never reverses a moving path.

    All this is computed from the setpoints that were sent, not from positions that drives report:
    those are as late as the control loop, and with repeated stalls the error would grow. Only a
    joint whose drive does not answer (``hold``) gets no setpoint, and continues from the command
    that the driver reports.

    Control-loop thread. Arrays are of shape (m,), setpoints (2, m): position and velocity.

    Args:
        start: setpoint of the joints at rest, before the first one is sent.
        start_ns: monotonic time until which they rest there.
        extrapolation_s: time by which the device goes on without setpoints before it holds, s.
        buffer_s: duration of the setpoints that the device holds ahead, s.

    Attributes:
        active: the present setpoint deviates from the path.
        pause_s: duration of the last underrun.
        left_plan: a source has left the motion that its successor was planned from.
        begins: the path begins at rest, and nothing was sent yet.
    """

    def __init__(
        self,
        start: FloatArray,
        start_ns: int,
        limits: JointLimits,
        extrapolation_s: float,
        buffer_s: float = 0.0,
    ) -> None:
        self.active = self.left_plan = False
        self.begins = True
        self.pause_s = self._longest_s = self._silence_s = 0.0  # the latter two: of the deviation
        self._extrapolation_s = extrapolation_s
        self._sent, self._sent_ns = start.copy(), start_ns
        self._sent_time_s = 0.0
        self._buffer_s = buffer_s
        self._filled_s = 0.0  # what the device holds ahead: nothing before the first setpoint
        self._buffered: deque[tuple[int, float, FloatArray]] = (
            deque([(start_ns, 0.0, start.copy())]) if buffer_s > 0.0 else deque()
        )
        self._deviation: FloatArray = np.zeros_like(start)  # of the last setpoint that was sent
        self._next: FloatArray = np.zeros_like(start)  # of the one that is not sent yet
        self._path_velocity: FloatArray = np.zeros_like(start[0])  # at the setpoint before
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
    def lags(self) -> bool:
        """A joint whose drive answers again has not caught up with the speed of the path."""
        if not (self.active and self._silence_s):
            return False
        return bool((np.abs(self._next[1]) > self._fastest + self._moving).any())

    @property
    def cause(self) -> str:
        """End of a sentence about what the deviation led to."""
        if self._silence_s > self._longest_s:
            return f"after its drive did not answer for {self._silence_s * 1e3:.0f} ms"
        return after_stall(self._longest_s)

    @property
    def is_far(self) -> BoolArray:
        """(m,) joints that cannot be led back within ``MAX_CATCH_UP_S``."""
        far: BoolArray = np.abs(self.offset) > MAX_CATCH_UP_S * self._fastest
        return far

    @property
    def nearness(self) -> float:
        """1 on the path, 0 where a joint is as far from it as may be led back."""
        far = np.abs(self._deviation[0]) / (MAX_CATCH_UP_S * self._fastest)
        return 1.0 - min(1.0, float(far.max())) if self.active else 1.0

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
        return self._sent_time_s + min(elapsed_s, self._extrapolation_s)

    def rest_until(self, start_ns: int) -> None:
        """Let the joints rest until ``start_ns``, while ``begins``: the first setpoint is late."""
        self._sent_ns = start_ns

    def begin_path(self, start_ns: int) -> None:
        """Count trajectory time from ``start_ns``: a successor continues from here."""
        self.begins = False
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
        self._next[:], self._path_velocity[:] = self._deviation, start.velocity
        self.active, self.left_plan = True, False

    def correct(self, path: FloatArray, due_ns: int, period_s: float) -> bool:
        """Turn the path's setpoint for ``due_ns`` into the one to send, in place.

        Returns True when an underrun was found: ``is_far`` then says whether it is too long.
        """
        elapsed_s = (due_ns - self._sent_ns) / NANOSECONDS
        underrun = self._is_underrun(elapsed_s, period_s)
        if underrun:
            self.pause_s = elapsed_s - period_s
            self._begin()
            self._longest_s = max(self.pause_s, self._longest_s)
            self._next[:] = self._sent
            # The setpoint is for a period later than the device is now.
            if self.pause_s > self._extrapolation_s:
                self._continue(elapsed_s, self._next)
            else:
                self._next[0] += elapsed_s * self._next[1]
            self._next -= path
        elif self.active:
            self._fade(path[1], elapsed_s)
        else:
            return False
        self._path_velocity[:] = path[1]
        path += self._next
        return underrun

    def hold(
        self, setpoint: FloatArray, silent: BoolArray, command: FloatArray, period_s: float
    ) -> None:
        """Keep joints whose drives do not answer at their commands, in place.

        Args:
            setpoint: (2, m) as ``correct`` has made it.
            silent: (m,) these joints, at least one.
            command: (m,) position from which the driver will continue each of them.
        """
        if not self.active:
            self._path_velocity[:] = setpoint[1]
        self._begin()
        self._silence_s += period_s
        before = setpoint[:, silent]
        setpoint[0, silent], setpoint[1, silent] = command[silent], 0.0
        self._next[:, silent] += setpoint[:, silent] - before

    def wait(
        self,
        due_ns: int,
        period_ns: int,
        rate: float,
        position_at: Callable[[float], FloatArray],
    ) -> float | None:
        """Let the path wait for a device that holds since an underrun.

        A path that has not begun does not wait. The deviation stays.

        Args:
            due_ns, period_ns: of the next setpoint, which continues from rest.
            rate: of trajectory time, at the last setpoint.
            position_at: returns (m,) positions of the path at a trajectory time.

        Returns the trajectory time at which it continues. None, without effect: the device moves.
        """
        held = self.held(due_ns, period_ns)
        if held is None:
            return None
        time_s = self._sent_time_s + rate * self._extrapolation_s
        if time_s < 0.0:
            time_s = min(0.0, self._sent_time_s + self.pause_s)
        deviation = held - position_at(time_s)
        if np.abs(deviation).max() < NEGLIGIBLE_DEVIATION:
            self.accept()
        else:
            self._begin()
            self._longest_s = max(self.pause_s, self._longest_s)
        self._deviation[:] = deviation, np.zeros_like(deviation)
        self._path_velocity[:] = 0.0
        self._sent[:] = held, self._deviation[1]
        self._sent_ns, self._sent_time_s = due_ns - period_ns, time_s
        return time_s

    def held(self, due_ns: int, period_ns: int) -> FloatArray | None:
        """Return (m,) positions at which the device holds since an underrun; None: it moves.

        ``due_ns``, ``period_ns``: of the next setpoint.
        """
        elapsed_s, period_s = (due_ns - self._sent_ns) / NANOSECONDS, period_ns / NANOSECONDS
        pause_s = elapsed_s - period_s
        if not self._is_underrun(elapsed_s, period_s) or pause_s <= self._extrapolation_s:
            return None
        self.pause_s = pause_s
        held: FloatArray = self._sent[0] + self._extrapolation_s * self._sent[1]
        return held

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
        self.begins, self._filled_s = False, self._buffer_s
        if self._buffered:
            self._buffered.append((due_ns, time_s, setpoint.copy()))

    def _begin(self) -> None:
        """Begin a deviation, unless there is one."""
        if not self.active:
            self.active, self._longest_s, self._silence_s = True, 0.0, 0.0

    def _is_underrun(self, elapsed_s: float, period_s: float) -> bool:
        return elapsed_s > UNDERRUN_PERIODS * period_s + self._filled_s

    def _of_buffer(self, time_ns: int) -> tuple[float, FloatArray]:
        """The last setpoint that was due by ``time_ns``, and its time; older ones are forgotten."""
        while len(self._buffered) > 1 and self._buffered[1][0] <= time_ns:
            self._buffered.popleft()
        return self._buffered[0][1:]

    def _continue(self, seconds: float, setpoint: FloatArray) -> None:
        """Turn the last setpoint into what the device has ``seconds`` after its due time."""
        setpoint[0] += min(seconds, self._extrapolation_s) * setpoint[1]
        if seconds > self._extrapolation_s:
            setpoint[1] = 0.0

    def _fade(self, path_velocity: FloatArray, elapsed_s: float) -> None:
        """Advance from the deviation of the last setpoint that was sent."""
        offset, rate = self._deviation
        back = np.clip(-offset / self._time_constant_s, -self._fastest, self._fastest)
        speed = np.abs(path_velocity)
        reversing = (back * path_velocity < 0.0) & (speed > self._moving)
        back = np.where(reversing, np.clip(back, -speed, speed), back)
        step, change = self._acceleration * elapsed_s, path_velocity - self._path_velocity
        least = MIN_ACCELERATION_SHARE * step
        down, up = np.minimum(-step - change, -least), np.maximum(step - change, least)
        new_rate = rate + np.clip(back - rate, down, up)
        self._next[0] = offset + 0.5 * (rate + new_rate) * elapsed_s
        self._next[1] = new_rate
        if (
            np.abs(self._next[0]).max() < NEGLIGIBLE_DEVIATION
            and np.abs(new_rate).max() < self._moving.min()
        ):
            self.active = False
            self._next[:] = 0.0
