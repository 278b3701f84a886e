"""Streamed velocities: the newest setpoint, sent by a thread of its own.

``StartVel`` returns when the engine has taken the command in, about one of its cycles later.
The control loop must not wait for that: it leaves its setpoint here. A setpoint that the next one
overtakes is never sent. The engine itself would go on at the last velocity for ever: an axis is
stopped when no setpoint comes for ``TIMEOUT_S``.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack

import numpy as np

from robotd.api import NANOSECONDS, BoolArray, FloatArray, RobotdError, get_logger
from robotd_wmx._native import CallError
from robotd_wmx.connection import WmxConnection
from robotd_wmx.errors import text_of

log = get_logger("wmx")

TIMEOUT_S = 0.25  # without a setpoint, until the axes are stopped


class VelocityStream:
    """Axes in velocity mode that obey ``put``.

    Args:
        connection: to the engine.
        slow_down: stops axes that get no setpoints any more.

    Attributes:
        active: (n,) the axes that are streamed now.
        rolling: (n,) of the axes whose streams have ended, those that no stop has reached yet.
        sent: (n,) the velocities that the engine has taken in last, rad/s or m/s.
    """

    def __init__(
        self, connection: WmxConnection, slow_down: Callable[[Sequence[int]], None]
    ) -> None:
        axes = connection.robot.axes
        self.active = np.zeros(axes, bool)
        self.rolling = np.zeros(axes, bool)
        self.sent: FloatArray = np.zeros(axes)
        self._connection, self._slow_down = connection, slow_down
        self._unstopped: set[int] = set()  # axes whose stop the engine has rejected
        self._period_ns = round(NANOSECONDS / connection.robot.cycle.rate_hz)
        self._reached_ns = np.zeros(axes, np.int64)  # when the ramp to the last setpoint ends
        self._velocity: FloatArray = np.full(axes, np.nan)
        self._number = 0  # of the newest setpoint
        self._accepted = np.zeros(axes, np.int64)  # number of the last one that the engine took in
        self._sending = threading.Lock()
        self._fresh = threading.Event()
        self._thread: threading.Thread | None = None

    def put(self, velocity: FloatArray) -> None:
        """Cycle thread: the velocities to be reached one period later, rad/s or m/s."""
        self._velocity[:] = velocity
        self._number += 1
        self._fresh.set()

    @property
    def behind(self) -> BoolArray:
        """(n,) axes that have not been commanded the newest setpoint. Cycle thread.

        The engine has rejected it, or the sender is late: a further step of a ramp would be added.
        """
        outdated: BoolArray = self._accepted != self._number
        return self.active & np.isfinite(self._velocity) & outdated

    def begin(self, axes: Sequence[int]) -> None:
        """Obey from now on."""
        self._velocity[list(axes)] = np.nan
        self._accepted[list(axes)] = self._number
        self.active[list(axes)], self.rolling[list(axes)] = True, False
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="wmx-stream", daemon=True)
            self._thread.start()

    def drop(self, axes: BoolArray) -> None:
        """Cycle thread: end the streams of ``axes`` (n,), which something has stopped.

        The engine rejects what is being sent to them at this moment.
        """
        self.active &= ~axes
        self.rolling &= ~axes

    def end(self, axes: Sequence[int]) -> list[int]:
        """Obey no longer: nothing is sent for ``axes`` afterwards. Return which of them roll."""
        with self._sending:
            ended = [axis for axis in axes if self.active[axis]]
            self.active[ended], self.rolling[ended] = False, True
        return [axis for axis in axes if self.rolling[axis]]

    def _run(self) -> None:
        failing = False
        while True:
            if not self._fresh.wait(TIMEOUT_S if self._feeds() else None):
                self._expire()
                continue
            self._fresh.clear()
            with self._sending:
                axes = self._feeds()
                if not axes:
                    continue
                try:
                    self._send(axes)
                    failing = False
                except (CallError, RobotdError) as error:
                    # The image shows what stopped the axes; the base gives up by that.
                    if not failing:
                        log.error("streaming failed", reason=_reason(error))
                    failing = True

    def _send(self, axes: list[int]) -> None:
        """An axis that the engine rejects leaves no other one at its last velocity.

        A setpoint that follows a late one closely adds what is left of that one's ramp to its own.
        """
        number = self._number  # before its setpoint: that may be newer, never older
        velocities = self._velocity[axes]
        units = velocities * self._connection.scaling.units[axes]
        now_ns = self._connection.clock.now_ns()
        rest_ns = max(0, min(self._period_ns, int(self._reached_ns[axes].max()) - now_ns))
        ramp_ns = self._period_ns + rest_ns
        try:
            self._connection.stream.start_vels(axes, units.tolist(), ramp_ns / 1e6)
            self._reached_ns[axes] = now_ns + ramp_ns
            self._accepted[axes], self.sent[axes] = number, velocities
        except CallError:
            if len(axes) == 1:
                raise
            with ExitStack() as stack:
                for axis in axes:
                    stack.callback(self._send, [axis])

    def _feeds(self) -> list[int]:
        """Return the axes that have got a setpoint since their stream began."""
        axes: list[int] = np.flatnonzero(self.active & np.isfinite(self._velocity)).tolist()
        return axes

    def _expire(self) -> None:
        """Stop what gets no setpoints; a stop that is rejected is repeated after ``TIMEOUT_S``."""
        stopped = []
        with self._sending:  # no other stop comes in between, and is followed by this gentler one
            for axis in self._feeds():
                try:
                    self._slow_down([axis])
                except (CallError, RobotdError) as error:
                    if axis not in self._unstopped:
                        log.error("stopping a stream failed", axis=axis, reason=_reason(error))
                    self._unstopped.add(axis)
                else:
                    self.active[axis] = False
                    self._unstopped.discard(axis)
                    stopped.append(axis)
        if stopped:
            log.warning("stopped: no setpoints arrive", axes=stopped, after_s=TIMEOUT_S)


def _reason(error: CallError | RobotdError) -> str:
    return text_of(*error.args[1:3]) if isinstance(error, CallError) else str(error)
