"""Latch that forbids motion."""

from __future__ import annotations

import threading
from collections.abc import Callable

from robotd.errors import NotReady, OperationError
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

        Raises NotReady: there were more than ``stops``; the newest one stays in force.
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
