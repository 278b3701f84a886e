"""Setpoint source: what the control loop advances in each period, and how its motion ends."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from enum import Enum, auto

from robotd.arrays import FloatArray, IntArray
from robotd.control.loop.stall_recovery import StallRecovery
from robotd.device.process_image import ProcessImage, columns
from robotd.motion import MotionState

PREEMPTED = "preempted by a new goal"


class Outcome(Enum):
    """Result of a trajectory."""

    SUCCEEDED = auto()
    CANCELED = auto()
    PREEMPTED = auto()
    PATH_TOLERANCE = auto()
    GOAL_TOLERANCE = auto()
    CONTACT = auto()  # of a motion that ends at one
    STOPPED = auto()  # by the operator or a stop input
    FAULT = auto()


class Completion:
    """Requested end and final outcome of one execution.

    Any thread may call ``request`` and wait for ``event``; the rest belongs to the control loop.

    Attributes:
        result: outcome and message for the client, None until they are known: at the end, or
            before it where the motion goes on after the goal (``announce``).
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
        """True once the source has ended: ``outcome`` is set."""
        return self.event.is_set()

    @property
    def goes_on(self) -> bool:
        """True where a successor may continue it: no end was requested, or it succeeded."""
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


class SetpointSource(ABC):
    """Motion of m axes: position, velocity and acceleration for each control period.

    A worker makes it and submits it to the ``SourceSlot`` of its axes; from then on it belongs to
    the control loop. It starts at rest, or continues the motion of another source (``take_over``).
    It ends with an outcome and a reason, its ``completion``, of its own accord or because a client
    requests it. After a success its setpoint holds the axes until a successor comes or the slot is
    released. Control-loop thread, except ``splice_state`` and ``completion``.

    By default it starts at rest, and nothing continues it.

    Args:
        axes: (m,) index of its axes among those of the device.
        start_ns: due time of its first setpoint, at the earliest.
        setpoint: (3, m) at the start.

    Attributes:
        columns: ``axes`` as an index.
        setpoint: (3, m) position, velocity and acceleration for the end of the period, in rad or m
            and s; position NaN for axes in velocity mode.
        completion: requested end, outcome, and the event to wait for.
        stall_recovery: deviation from its path after an underrun, which a successor continues;
            None: it keeps none.
    """

    def __init__(self, axes: Sequence[int] | IntArray, start_ns: int, setpoint: FloatArray) -> None:
        self.columns = columns(axes)
        self.start_ns, self.setpoint = start_ns, setpoint
        self.completion = Completion()
        self.stall_recovery: StallRecovery | None = None

    @property
    def rate(self) -> float:
        """Ratio of its own time to real time. Any thread."""
        return 1.0

    def splice_state(self, time_ns: int) -> MotionState | None:
        """Return the state at ``time_ns`` for a successor to plan from. Any thread.

        With the derivatives at a ``rate`` of 1, and for the present ``start_ns``: a source that is
        slowed down reaches the state later, by as much as its ``start_ns`` moves. None: a
        successor has to wait until it has ended.
        """
        return None

    def end_splice(self) -> None:  # noqa: B027 - most sources do as planned
        """Note that no successor is planned from a ``splice_state``. Any thread."""

    def take_over(  # noqa: B027 - most sources start at rest
        self, running: SetpointSource, advanced_ns: int, delay_ns: int
    ) -> None:
        """Continue from the setpoint of ``running``, made in the period ``advanced_ns``.

        ``delay_ns``: time by which ``running`` was slowed down since this source was planned;
        its start is as much later.
        """

    @abstractmethod
    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> bool:
        """Compute the setpoint for ``time_ns + period_ns``; return False when it has none.

        Also called after its end, until it is replaced or released.
        """

    def sent(self, due_ns: int) -> None:  # noqa: B027 - not every source needs it
        """Note that the device got ``setpoint``, due at ``due_ns``; not called for a late one."""
