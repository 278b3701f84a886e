"""Setpoint sources, and the slot of a group of axes: running source, successor, handover."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Sequence

from robotd.arrays import FloatArray, IntArray
from robotd.control.completion import Completion, Outcome
from robotd.control.stall_recovery import StallRecovery
from robotd.device.process_image import ProcessImage, columns
from robotd.motion import MotionState


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


PREEMPTED = "preempted by a new goal"
ABANDONED = "the joints did not come to rest in time"
NOT_RUNNING = "the control loop is not running"
SPLICE_LOST = "the running trajectory was stopped before this one could take over"


class SourceSlot:
    """Decides which source moves its axes in each period. Made by ``SetpointMixer.slot``.

    ``submit``, ``release_after`` and ``release`` are for the worker that has claimed the axes;
    ``select`` and ``device_lost`` for the mixer.

    Attributes:
        running: source that moves the axes, or holds them after its end.
    """

    def __init__(self, period_ns: int) -> None:
        self.period_ns = period_ns
        self.running: SetpointSource | None = None
        self._next: SetpointSource | None = None
        self._planned_ns = 0  # start of the running source that the next one was planned by
        self._due_ns = 0
        self._lost: str | None = NOT_RUNNING
        self._handover = threading.Lock()

    @property
    def active(self) -> list[SetpointSource]:
        """Running source and its successor, without those that have ended."""
        sources = (self.running, self._next)
        return [each for each in sources if each is not None and not each.completion.done]

    @property
    def next_start_ns(self) -> int:
        """Earliest start of a source from rest that is submitted now."""
        return self._due_ns + self.period_ns

    def submit(
        self, source: SetpointSource, after: SetpointSource | None, planned_ns: int = 0
    ) -> bool:
        """Run ``source``: at once from rest, else from its ``start_ns`` on.

        The axes must be in streaming. Where the device is lost, it ends with a fault at once.

        Args:
            source: takes the place of a waiting one.
            after: the moving source that it continues; None: it begins at rest.
            planned_ns: ``start_ns`` of ``after`` when the state to start from was read.

        Returns False, without effect, when its start time has passed, or ``after`` is no longer the
        running one or is ending: plan again.
        """
        with self._handover:
            if self._lost is not None:
                source.completion.finish(Outcome.FAULT, self._lost)
                return True
            goes_on = after is None or after.completion.goes_on
            delay_ns = 0 if after is None else after.start_ns - planned_ns
            late = source.start_ns + delay_ns < self._due_ns
            if self.running is not after or not goes_on or late:
                return False
            self._drop_next(Outcome.PREEMPTED, PREEMPTED)
            if after is None:
                self.running = source
            else:
                self._planned_ns, self._next = planned_ns, source
            return True

    def release_after(self, running: SetpointSource | None) -> bool:
        """Stop holding the axes after ``running``, which has ended.

        Returns False, without effect, when another source runs by now.
        """
        with self._handover:
            if self.running is not running:
                return False
            self._drop_next(Outcome.PREEMPTED, PREEMPTED)
            self.running = None
            return True

    def end_splice(self) -> None:
        """Let the running source go on by itself unless a successor waits; none is planned now."""
        with self._handover:
            if self.running is not None and self._next is None:
                self.running.end_splice()

    def release(self) -> None:
        """Stop streaming; after the last source has ended, before ``end_stream``."""
        with self._handover:
            self._drop(Outcome.FAULT, ABANDONED)

    def select(self, time_ns: int) -> SetpointSource | None:
        """Return the source of the setpoint due a period after ``time_ns``; None: no setpoint.

        Once in each period. After a fault there is none: the device has stopped the axes.
        """
        advanced_ns = self._due_ns - self.period_ns
        self._due_ns, self._lost = time_ns + self.period_ns, None
        if self._next is not None:
            with self._handover:
                self._take_over(advanced_ns)
        source = self.running
        failed = source is not None and source.completion.outcome is Outcome.FAULT
        return None if failed else source

    def device_lost(self, reason: str) -> None:
        """Fail both sources: the device cannot be reached."""
        self._lost = reason
        with self._handover:
            self._drop(Outcome.FAULT, reason)

    def _take_over(self, advanced_ns: int) -> None:
        """Start the successor if its time has come, or end it. Lock held."""
        successor, running = self._next, self.running
        if successor is None or running is None:
            return
        if successor.completion.requested is not None:
            self._drop_next(*successor.completion.requested)
            return
        if not running.completion.goes_on:
            self._drop_next(Outcome.FAULT, SPLICE_LOST)
            return
        # How far the running source was slowed down since its successor was planned, and is now.
        delay_ns = running.start_ns - self._planned_ns
        slower_ns = round((1.0 - running.rate) * self.period_ns)
        has_reached = self._due_ns - slower_ns >= successor.start_ns + delay_ns
        if running.completion.done or has_reached:
            successor.take_over(running, advanced_ns, delay_ns)
            running.completion.finish(Outcome.PREEMPTED, PREEMPTED)
            self.running, self._next = successor, None

    def _drop(self, outcome: Outcome, message: str) -> None:
        self._drop_next(outcome, message)
        if self.running is not None:
            self.running.completion.finish(outcome, message)
            self.running = None

    def _drop_next(self, outcome: Outcome, message: str) -> None:
        if self._next is not None:
            self._next.completion.finish(outcome, message)
            self._next = None
