"""Stops: the latch that forbids motion, and stops that the control loop requests."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from queue import SimpleQueue

from robotd.device.drivers import AxisDriver
from robotd.errors import NotReady, OperationError, RobotdError
from robotd.log import get_logger

log = get_logger("stop")

StopListener = Callable[[str], None]


class StopLatch:
    """Reason why no motion may start: read-only axes, a stop, or a lifecycle.

    Any thread. Commands check it before they start motion; ``MotionStop`` ends what runs.

    ``repeated``: called with the reason of a stop while motion is stopped already.

    Attributes:
        read_only: the axes cannot be commanded at all.
        reason: of the first stop since the last reset; "" while motion is allowed.
        inactive: state of a managed robot in which nothing moves; "": it is active, or not managed.
        servos_allowed: servos may be switched on.
        stops: number of stops so far, those of motion that was stopped already included.
    """

    def __init__(self, read_only: str = "", repeated: StopListener = lambda reason: None) -> None:
        self.read_only = read_only
        self._repeated = repeated
        self.reason = self.inactive = ""
        self.servos_allowed, self.stops = True, 0
        self._lock = threading.Lock()
        self._listeners: list[StopListener] = []

    @property
    def cause(self) -> str:
        """Reason why nothing moves, as text; "" while motion is allowed."""
        if self.inactive:
            return f"the robot is {self.inactive}"
        return f"motion is stopped: {self.reason}" if self.reason else ""

    @property
    def rejection(self) -> str:
        """Text with which a motion command is rejected; "" while motion is allowed."""
        if self.inactive:
            return f"{self.cause}: its lifecycle manager has to activate it"
        return f"{self.cause}; robotd reset allows it again" if self.reason else ""

    def check_commandable(self) -> None:
        """Raise OperationError where the axes are read-only."""
        if self.read_only:
            raise OperationError(self.read_only)

    def check(self) -> None:
        """Raise NotReady while motion is stopped, or the robot is not active.

        OperationError where the axes are read-only.
        """
        self.check_commandable()
        if rejection := self.rejection:
            raise NotReady(rejection)

    def check_servos(self) -> None:
        """Raise NotReady while no servo may be switched on; OperationError: read-only axes."""
        self.check_commandable()
        if not self.servos_allowed:
            raise NotReady(self.rejection)

    def on_change(self, listener: StopListener) -> None:
        """Call ``listener(reason)`` now and on every change, from the thread that causes it.

        It must not block: the control loop may cause a stop.
        """
        with self._lock:
            self._listeners.append(listener)
            listener(self.reason)

    def engage(self, reason: str) -> None:
        """Forbid motion; a later reason does not replace the first. Read-only axes: no effect."""
        with self._lock:
            if not reason or self.read_only:
                return
            self.stops += 1
            if self.reason:
                self._repeated(reason)
            else:
                self._change(reason)

    def release(self, stops: int) -> None:
        """Allow motion again; nothing starts to move.

        Raises NotReady: there were more than ``stops``, the stop of a moment ago stays in force.
        """
        with self._lock:
            if self.stops != stops:
                raise NotReady("motion was stopped again meanwhile")
            if self.reason:
                self._change("")

    def _change(self, reason: str) -> None:
        self.reason = reason
        if reason:
            log.warning("motion stopped", reason=reason)
        else:
            log.info("motion allowed again")
        for listener in self._listeners:
            listener(reason)


class StopRequests:
    """Calls ``AxisDriver.stop`` for the control loop, which never waits for a driver.

    A stop that takes long delays other stops that the control loop requests, and nothing else.
    Before ``start``, as in simulated time, the requesting thread calls the driver.
    """

    def __init__(self, driver: AxisDriver, names: Sequence[str]) -> None:
        self._driver, self._names = driver, names
        self._read_only = bool(driver.read_only)
        self._requested = [False] * len(names)
        self._wake: SimpleQueue[None] = SimpleQueue()  # its ``put`` never waits
        self._closing = False
        self._thread: threading.Thread | None = None

    def request(self, axes: Sequence[int]) -> None:
        """Start a controlled stop of ``axes`` soon; read-only ones: no effect.

        Control loop; never blocks, never raises.
        """
        if self._read_only:
            return
        new = [axis for axis in axes if not self._requested[axis]]
        for axis in new:
            self._requested[axis] = True
        if self._thread is None:
            self._stop()
        elif new:
            self._wake.put(None)

    def start(self) -> None:
        """Start the thread ``robotd-axis-stops``; no effect while it runs, or after ``close``."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="robotd-axis-stops", daemon=True)
            self._thread.start()

    def close(self, timeout_s: float) -> None:
        """End the thread; one that hangs in the driver is abandoned after ``timeout_s``."""
        self._closing = True
        thread = self._thread
        if thread is not None:
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
