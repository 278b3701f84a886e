"""Emulator of MoveIt Servo of ROS 2 Jazzy: what it publishes for a joint jog, without MoveIt.

After the sources of ``moveit_servo``, whose parameters have the same names: the loop of
``servo_node.cpp``, ``getNextJointState`` and ``smoothHalt`` of ``servo.cpp``,
``updateSlidingWindow`` and ``composeTrajectoryMessage`` of ``utils/common.cpp``, and the filter of
``online_signal_smoothing``. ``TrajectoryController`` is a model of joint_trajectory_controller that
samples the messages.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from robotd.arrays import FloatArray

MIN_POINTS = 3  # MIN_POINTS_FOR_TRAJ_MSG
STOPPED_VELOCITY = 1e-4  # STOPPED_VELOCITY_EPS
FILTER_COEFFICIENT = 1.5  # default of butterworth_filter_coeff


@dataclass
class State:
    """``KinematicState``."""

    time_s: float
    position: FloatArray
    velocity: FloatArray


class Message(NamedTuple):
    """A JointTrajectory.

    Attributes:
        sent_s: time at which it is published.
        stamp_s: of the header.
        times_s, position, velocity: (n,), (n, m), (n, m) of the points.
    """

    sent_s: float
    stamp_s: float
    times_s: FloatArray
    position: FloatArray
    velocity: FloatArray


@dataclass
class ServoEmulator:
    """One Servo node for joints of an arm; time is an argument.

    Args:
        publish_period, max_expected_latency, use_smoothing: parameters of Servo, s.
    """

    publish_period: float = 0.01
    max_expected_latency: float = 0.1
    use_smoothing: bool = True
    _window: deque[State] = field(default_factory=deque)
    _filter: _Butterworth | None = None
    _commanded: FloatArray | None = None

    def jog(
        self, now_s: float, velocity: Sequence[float], measured: Sequence[float]
    ) -> Message | None:
        """One turn of the loop with a jog; a singularity scales ``velocity`` down to 0."""
        current = self._current(now_s, measured)
        position = current.position + np.array(velocity) * self.publish_period
        if self.use_smoothing:
            position = self._smoother(current.position)(position)
        moved = (position - current.position) / self.publish_period
        return self._publish(State(now_s, position, moved), now_s)

    def halt(self, now_s: float, measured: Sequence[float]) -> Message | None:
        """One turn of the loop after the jog has become stale; None: it has stopped."""
        current = self._current(now_s, measured)
        if self._commanded is None:
            return None
        velocity = (self._commanded - np.array(measured)) / self.publish_period
        velocity[np.abs(velocity) <= STOPPED_VELOCITY] = 0.0
        position = self._commanded.copy()
        if self.use_smoothing:
            position = self._smoother(current.position)(position)
        if np.abs(velocity).sum() <= STOPPED_VELOCITY:
            return self.pause(now_s, measured)
        return self._publish(State(now_s, position, velocity), now_s)

    def pause(self, now_s: float, measured: Sequence[float]) -> None:
        """One turn of the loop without a command, or with a collision: nothing is published."""
        current = self._current(now_s, measured)
        self._slide(State(now_s, current.position.copy(), current.velocity.copy()), now_s)
        self._filter = None

    def _current(self, now_s: float, measured: Sequence[float]) -> State:
        if self._window and self._window[-1].time_s > now_s:
            return self._window[-1]
        self._window.clear()
        return State(now_s, np.array(measured, np.float64), np.zeros(len(measured)))

    def _smoother(self, position: FloatArray) -> _Butterworth:
        if self._filter is None:
            self._filter = _Butterworth(position)
        return self._filter

    def _publish(self, state: State, now_s: float) -> Message | None:
        self._slide(state, now_s)
        self._commanded = state.position
        if len(self._window) < MIN_POINTS:
            return None
        states = [*self._window][:-1]  # the velocity of the last one is not known yet
        stamp_s = states[0].time_s
        return Message(
            now_s,
            stamp_s,
            np.array([state.time_s for state in states]) - stamp_s,
            np.array([state.position for state in states]),
            np.array([state.velocity for state in states]),
        )

    def _slide(self, state: State, now_s: float) -> None:
        """``updateSlidingWindow``."""
        window = self._window
        state.time_s = now_s + self.max_expected_latency
        while window and window[0].time_s < now_s - self.max_expected_latency:
            window.popleft()
        while window and window[-1].time_s == state.time_s:
            window.pop()
        if len(window) >= 2:
            before, last = window[-2], window[-1]
            turns = np.sign(before.position - last.position) == np.sign(
                state.position - last.position
            )
            following = (state.position - last.position) / (state.time_s - last.time_s)
            previous = (last.position - before.position) / (last.time_s - before.time_s)
            smaller = np.where(np.abs(following) < np.abs(previous), following, previous)
            last.velocity = np.where(turns, 0.0, smaller)
            state.velocity = last.velocity.copy()
        window.append(state)


class _Butterworth:
    """First-order low-pass filter of positions."""

    def __init__(self, position: FloatArray) -> None:
        self._input = self._output = position

    def __call__(self, position: FloatArray) -> FloatArray:
        total = self._input + position - (1.0 - FILTER_COEFFICIENT) * self._output
        self._input = position
        self._output = total / (1.0 + FILTER_COEFFICIENT)
        return self._output


class Jog(NamedTuple):
    """A run of the emulator.

    Attributes:
        messages: in order.
        states: (k, 1 + m) time and position of everything that they command.
    """

    messages: list[Message]
    states: FloatArray

    @classmethod
    def of(cls, messages: list[Message]) -> Jog:
        """Return the run with these messages; of each time the first position counts."""
        states: dict[float, FloatArray] = {}
        for message in messages:
            for time_s, position in zip(message.times_s, message.position, strict=True):
                states.setdefault(round(message.stamp_s + time_s, 6), position)
        return cls(messages, np.array(sorted((time_s, *state) for time_s, state in states.items())))

    @property
    def fastest(self) -> float:
        """Highest velocity in a message."""
        return max(float(np.abs(message.velocity).max()) for message in self.messages)

    def commanded(self, time_s: float) -> FloatArray:
        """Return the position (m,) that was commanded for a time."""
        columns = self.states.T
        return np.array([np.interp(time_s, columns[0], column) for column in columns[1:]])

    def largest_error(self, rows: FloatArray) -> float:
        """Return the largest distance of rows of time and position from what was commanded."""
        begin, end = self.states[0, 0], self.states[-1, 0]
        rows = rows[(rows[:, 0] >= begin) & (rows[:, 0] <= end)]
        return max(float(np.abs(row[1:] - self.commanded(row[0])).max()) for row in rows)


def run(
    servo: ServoEmulator,
    velocity: Callable[[float], Sequence[float] | None],
    duration_s: float,
    *,
    jitter_s: float = 0.0,
    begin_s: float = 0.0,
    start: Sequence[float] = (0.0, 0.0, 0.0),
    seed: int = 1,
) -> Jog:
    """Run Servo with ``velocity(time)``; None: its commands have ended, and it halts.

    Args:
        servo: at rest.
        velocity: of the joints, rad/s.
        duration_s: of the run.
        jitter_s: greatest lateness of a turn of its loop.
        begin_s: time of the first turn.
        start: position of the joints.
        seed: of the lateness.
    """
    late = np.random.default_rng(seed)
    messages: list[Message] = []
    halted = 0
    for turn in range(round(duration_s / servo.publish_period)):
        now_s = begin_s + turn * servo.publish_period + late.uniform(0.0, jitter_s)
        commanded = velocity(now_s - begin_s)
        measured = messages[-1].position[-1] if messages else np.array(start)
        if commanded is not None:
            halted, message = 0, servo.jog(now_s, commanded, measured)
        else:  # as long as the arm takes to arrive
            halted += 1
            lag = [1e-3] if halted * servo.publish_period < servo.max_expected_latency else [0.0]
            message = servo.halt(now_s, measured - np.array(lag))
        if message is not None:
            messages.append(message)
    return Jog.of(messages)


class TrajectoryController:
    """Model of joint_trajectory_controller: a message replaces the one before, sampled by time.

    Before the first point it goes there from the state at which the message came.
    """

    def __init__(self, position: Sequence[float]) -> None:
        self._position, self._velocity = np.array(position, np.float64), np.zeros(len(position))
        self._message: Message | None = None
        self._came: State = State(0.0, self._position, self._velocity)

    def take(self, message: Message, now_s: float) -> None:
        """Replace the trajectory by ``message``."""
        self._came = State(now_s, *self.at(now_s))
        self._message = message

    def at(self, now_s: float) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity at a time that does not go back."""
        message = self._message
        if message is None:
            return self._position, self._velocity
        times = message.stamp_s + message.times_s
        index = int(np.searchsorted(times, now_s, side="right"))
        if index == len(times):
            return message.position[-1], np.zeros_like(message.velocity[-1])
        end = State(times[index], message.position[index], message.velocity[index])
        begin = self._came
        if index:
            before = index - 1
            begin = State(times[before], message.position[before], message.velocity[before])
        return _hermite(begin, end, now_s)


def _hermite(begin: State, end: State, now_s: float) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity on the cubic between two states."""
    h, s = end.time_s - begin.time_s, now_s - begin.time_s
    if h <= 0.0:
        return end.position, end.velocity
    step = (end.position - begin.position) / h
    c2 = (3.0 * step - 2.0 * begin.velocity - end.velocity) / h
    c3 = (begin.velocity + end.velocity - 2.0 * step) / h**2
    position = begin.position + s * (begin.velocity + s * (c2 + s * c3))
    return position, begin.velocity + s * (2.0 * c2 + 3.0 * s * c3)
