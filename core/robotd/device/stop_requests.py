"""Stops that the control loop requests; a thread of their own calls the driver."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from queue import SimpleQueue

from robotd.device.drivers import AxisDriver
from robotd.errors import RobotdError
from robotd.log import get_logger

log = get_logger("stop")


class StopRequests:
    """Calls ``AxisDriver.stop`` for the control loop, which never waits for a driver.

    A stop that takes long delays other stops that the control loop requests, and nothing else.
    Before ``start``, as in simulated time, the requesting thread calls the driver.

    Args:
        driver: of the axes.
        names: per axis, for the log.
    """

    def __init__(self, driver: AxisDriver, names: Sequence[str]) -> None:
        self._driver, self._names = driver, names
        self._requested = [False] * len(names)
        self._wake: SimpleQueue[None] = SimpleQueue()  # its ``put`` never waits
        self._closing = False
        self._thread: threading.Thread | None = None

    def request(self, axes: Sequence[int]) -> None:
        """Start a controlled stop of ``axes`` soon. Control loop; never blocks, never raises."""
        new = [axis for axis in axes if not self._requested[axis]]
        for axis in new:
            self._requested[axis] = True
        if self._thread is None:
            self._stop()
        elif new:
            self._wake.put(None)

    def start(self) -> None:
        """Start the thread ``robotd-axis-stops``. A second call has no effect."""
        if self._thread is None:
            self._closing = False
            self._thread = threading.Thread(target=self._run, name="robotd-axis-stops", daemon=True)
            self._thread.start()

    def close(self, timeout_s: float) -> None:
        """End the thread; one that hangs in the driver is abandoned after ``timeout_s``."""
        thread = self._thread
        if thread is not None:
            self._closing = True
            self._wake.put(None)
            thread.join(timeout_s)
            self._thread = None

    def _run(self) -> None:
        while not self._closing:
            self._wake.get()
            self._stop()

    def _stop(self) -> None:
        axes = [axis for axis, requested in enumerate(self._requested) if requested]
        for axis in axes:  # before the call: a request that comes meanwhile is a new one
            self._requested[axis] = False
        if not axes:
            return
        try:
            self._driver.stop(axes)
        except RobotdError as error:
            names = [self._names[axis] for axis in axes]
            log.error("stopping the axes failed", axes=names, reason=str(error))
