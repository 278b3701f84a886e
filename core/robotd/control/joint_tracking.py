"""Desired and measured motion of the joints of an execution."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.motion import Tolerances, Trajectory, Violation


@dataclass(frozen=True)
class Progress:
    """Progress of an execution; arrays (m,) in the order of the trajectory's names."""

    time_s: float
    desired_position: FloatArray
    desired_velocity: FloatArray
    actual_position: FloatArray
    actual_velocity: FloatArray


class JointTracking:
    """Desired and measured motion of m joints in the present period.

    ``progress`` may be called by any thread, the rest belongs to the control loop.

    ``setpoint``: (2, m) position and velocity at the start.

    Attributes:
        desired, measured: (2, m) position and velocity of the present period.
    """

    def __init__(self, setpoint: FloatArray) -> None:
        self._motion: FloatArray = np.stack([setpoint, setpoint])
        self.desired, self.measured = self._motion
        self._max_error = [0.0] * setpoint.shape[1]
        # Replaced as a whole: another thread sees the values of one period.
        self._snapshot = (0.0, self._motion.copy())

    @property
    def max_error(self) -> FloatArray:
        """(m,) largest following error so far, rad or m."""
        return np.array(self._max_error)

    def update(self, measured: FloatArray, time_s: float) -> None:
        """Take the ``measured`` (2, m) of a period, whose ``desired`` is written already.

        The errors in plain floats: NumPy would take three functions that run nowhere else in a
        period.
        """
        self.measured[:] = measured
        worst, position = self._max_error, self.measured[0].tolist()
        for joint, wanted in enumerate(self.desired[0].tolist()):
            # NaN leaves the maximum as it is.
            worst[joint] = max(worst[joint], abs(wanted - position[joint]))
        self._snapshot = time_s, self._motion.copy()

    def progress(self) -> Progress:
        """Return the values of one control period: path at ``time_s`` and measurement."""
        time_s, (desired, measured) = self._snapshot
        return Progress(time_s, desired[0], desired[1], measured[0], measured[1])


class CommandHistory:
    """Commands of m joints by the time at which the device had them. Control-loop thread.

    A measured value is compared with the command of its own time: at 3 rad/s a value that is 10 ms
    old would otherwise look like a following error of 0.03 rad.
    """

    def __init__(self) -> None:
        self._commands: deque[tuple[int, FloatArray]] = deque()

    def add(self, time_ns: int, command: FloatArray) -> None:
        """Append the ``command`` (2, m) position and velocity of ``time_ns``, which increases."""
        self._commands.append((time_ns, command.copy()))

    def recall(self, time_ns: int, out: FloatArray) -> float:
        """Write the command of ``time_ns`` into ``out`` (2, m); return its age in seconds.

        Commands before it are forgotten. Between two commands it is interpolated. Before the
        first one the joints moved with its velocity; after the last one it is the last one.
        """
        commands, newest_ns = self._commands, self._commands[-1][0]
        while len(commands) > 2 and commands[1][0] <= time_ns:
            commands.popleft()
        first_ns, first = commands[0]
        if time_ns <= first_ns or len(commands) == 1:
            early_s = max(0, first_ns - time_ns) / NANOSECONDS
            out[:] = first
            out[0] -= early_s * first[1]
        else:
            second_ns, second = commands[1]
            share = min(1.0, (time_ns - first_ns) / (second_ns - first_ns))
            out[:] = first
            out += share * (second - first)
        return max(0, newest_ns - time_ns) / NANOSECONDS


class GoalPassage:
    """Finds out when every joint has passed the last point of its goal. Control-loop thread.

    A joint passes it when its measured position is within the goal tolerance of the point, or
    crosses it between two periods, at the time of the point or later: joints that follow with
    different lags pass one after the other.
    """

    def __init__(self, trajectory: Trajectory, goal_s: float, tolerances: Tolerances) -> None:
        self._goal_s, self._tolerances = goal_s, tolerances
        self._point = trajectory.state_at(goal_s).position
        self._closest: FloatArray = np.full_like(self._point, np.inf)
        self._before: FloatArray = np.full_like(self._point, np.nan)

    def update(self, time_s: float, measured: FloatArray) -> bool:
        """Take positions (m,) measured at trajectory time ``time_s``; True: all have passed."""
        error = measured - self._point
        if time_s >= self._goal_s:
            distance = np.where(error * self._before <= 0.0, 0.0, np.abs(error))
            np.fmin(self._closest, distance, self._closest)
        self._before = error
        return time_s >= self._goal_s and self.violation() is None

    def violation(self) -> Violation | None:
        """Return the joint that came least close to the point; None when all have passed."""
        rest = np.zeros_like(self._point)
        return self._tolerances.check_goal(self._goal_s, self._closest, rest, rest)
