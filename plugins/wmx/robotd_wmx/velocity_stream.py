"""Streamed velocities: the newest setpoint, sent by a thread of its own.

``StartVel`` returns when the engine has taken the command in, about one of its cycles later.
The control loop must not wait for that: it leaves its setpoint here. A setpoint that the next one
overtakes is never sent.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np

from robotd.api import FloatArray, RobotdError, get_logger
from robotd_wmx._native import CallError
from robotd_wmx.connection import Connection
from robotd_wmx.errors import text_of

log = get_logger("wmx")


class VelocityStream:
    """Axes in velocity mode that obey ``put``.

    Attributes:
        active: (n,) the axes that are streamed now.
    """

    def __init__(self, connection: Connection) -> None:
        axes = connection.robot.axes
        self.active = np.zeros(axes, bool)
        self._connection = connection
        self._ramp_ms = 1000.0 / connection.robot.cycle.rate_hz
        self._velocity: FloatArray = np.full(axes, np.nan)
        self._sending = threading.Lock()
        self._fresh = threading.Event()
        self._thread: threading.Thread | None = None

    def put(self, velocity: FloatArray) -> None:
        """Cycle thread: the velocities to be reached one period later, rad/s or m/s."""
        self._velocity[:] = velocity
        self._fresh.set()

    def begin(self, axes: Sequence[int]) -> None:
        """Obey from now on."""
        self._velocity[list(axes)] = np.nan
        self.active[list(axes)] = True
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="wmx-stream", daemon=True)
            self._thread.start()

    def end(self, axes: Sequence[int]) -> list[int]:
        """Obey no longer; which of ``axes`` did. Nothing is sent for them afterwards."""
        with self._sending:
            ended = [axis for axis in axes if self.active[axis]]
            self.active[ended] = False
        return ended

    def _run(self) -> None:
        failing = False
        while self._fresh.wait():
            self._fresh.clear()
            with self._sending:
                axes = np.flatnonzero(self.active & np.isfinite(self._velocity))
                if not len(axes):
                    continue
                velocities = self._velocity[axes] * self._connection.scaling.units[axes]
                try:
                    self._connection.stream.start_vels(
                        axes.tolist(), velocities.tolist(), self._ramp_ms
                    )
                    failing = False
                except (CallError, RobotdError) as error:
                    # The image shows what stopped the axes; the base gives up by that.
                    if not failing:
                        log.error("streaming failed", reason=_reason(error))
                    failing = True


def _reason(error: CallError | RobotdError) -> str:
    return text_of(*error.args[1:3]) if isinstance(error, CallError) else str(error)
