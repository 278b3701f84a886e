"""Commands of the last periods, for measured values that are older than the present one."""

from __future__ import annotations

from collections import deque

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS


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
