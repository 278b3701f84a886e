"""Completion of an execution: requested end, outcome, and the event that waiters block on."""

from __future__ import annotations

import threading
from collections.abc import Callable
from enum import Enum, auto


class Outcome(Enum):
    """Result of a trajectory."""

    SUCCEEDED = auto()
    CANCELED = auto()
    PREEMPTED = auto()
    PATH_TOLERANCE = auto()
    GOAL_TOLERANCE = auto()
    STOPPED = auto()  # by the operator or a stop input
    FAULT = auto()


class Completion:
    """Requested end and final outcome of one execution.

    Any thread may call ``request`` and wait for ``event``; the rest belongs to the control loop.

    Attributes:
        result: outcome and message for the client, None until they are known: at the end, or
            before it where the motion goes on behind the goal (``announce``).
        known: set with ``result``.
        outcome, message: None and "" until it has ended; never change afterwards.
        event: set with ``outcome``.
        on_end: called after an end was requested and when it has ended, in the same thread.
    """

    def __init__(self) -> None:
        # One writer each: a request at the moment of a fault cannot hide it.
        self._wish: tuple[Outcome, str] | None = None  # by any thread
        self._fault: tuple[Outcome, str] | None = None  # by the control loop
        self.outcome: Outcome | None = None
        self.message = ""
        self.event = threading.Event()
        self.result: tuple[Outcome, str] | None = None
        self.known = threading.Event()
        self.on_end: Callable[[], None] = lambda: None

    @property
    def requested(self) -> tuple[Outcome, str] | None:
        """Outcome and message to end with, None: it runs on. Set before ``outcome``."""
        return self._fault or self._wish

    @property
    def done(self) -> bool:
        """It has ended: ``outcome`` is set."""
        return self.event.is_set()

    @property
    def goes_on(self) -> bool:
        """No end was requested, or it ended with success: a successor may continue it."""
        if self.outcome is None:
            return self.requested is None
        return self.outcome is Outcome.SUCCEEDED

    @property
    def is_fault(self) -> bool:
        """An end with a fault was requested."""
        ending = self.requested
        return ending is not None and ending[0] is Outcome.FAULT

    def request(self, outcome: Outcome, message: str) -> None:
        """Request the end; no effect after the first request or after the end."""
        if self.requested is None and self.outcome is None:
            self._wish = (outcome, message)
        self.on_end()

    def escalate(self, message: str) -> None:
        """Request the end with a fault, also while it stops for another reason."""
        if (ending := self.requested) is not None:
            message = f"{message} (while stopping: {ending[1]})"
        self._fault = (Outcome.FAULT, message)
        self.on_end()

    def announce(self, outcome: Outcome, message: str) -> None:
        """Set the result for the client before the end; no effect when there is one."""
        if self.result is None:
            self.result = (outcome, message)
            self.known.set()

    def finish(self, outcome: Outcome, message: str) -> None:
        """Set the outcome; no effect when there is one."""
        if self.outcome is None:
            self.outcome, self.message = outcome, message
            self.announce(outcome, message)
            self.on_end()  # before a waiter acts on the end
            self.event.set()
