"""Mixer of the setpoints of all sources, with a slot for each group of axes."""

from __future__ import annotations

import threading

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, Clock, MonotonicClock
from robotd.control.loop.period_timing import LoopStatistics
from robotd.control.loop.setpoint_source import PREEMPTED, Outcome, SetpointSource
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import STREAMING, Underrun
from robotd.errors import LateSetpoint

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
        return [source for source in sources if source is not None and not source.completion.done]

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


class SetpointMixer:
    """Slots of all groups of axes; sends their setpoints together. Control-loop thread.

    Args:
        axes: number of axes of the device.
        clock: of the device and of the control loop; None: monotonic.

    Attributes:
        due_ns: due time of the last setpoints; 0 before the first period.
        sent_ns: due time of the last setpoints that the device got; 0 before the first.
        extrapolates: the device extrapolates missing setpoints; late ones are not sent then.
        stats: of the control loop; counts the setpoints that came too late and were not sent.
    """

    def __init__(
        self, driver: AxisDriver, axes: int, rate_hz: float, clock: Clock | None = None
    ) -> None:
        self.period_ns = round(NANOSECONDS / rate_hz)
        self.due_ns = 0
        self.sent_ns = 0
        self.stats = LoopStatistics()
        self.extrapolates = driver.underrun is Underrun.EXTRAPOLATE
        self._buffers = driver.stream_buffer_s > 0.0
        self._driver = driver
        self._clock = clock or MonotonicClock()
        self._setpoints: FloatArray = np.full((2, axes), np.nan)
        self._position, self._velocity = self._setpoints
        self._slots: list[SourceSlot] = []

    def slot(self) -> SourceSlot:
        """Return a new slot for a group of axes; before the control loop starts."""
        slot = SourceSlot(self.period_ns)
        self._slots.append(slot)
        return slot

    @property
    def active(self) -> bool:
        """A source moves axes, or waits to. Any thread."""
        return any(slot.active for slot in self._slots)

    def end_all(self, outcome: Outcome, reason: str) -> None:
        """Request the end of all sources, each by its own controlled stop. Any thread."""
        for slot in self._slots:
            for source in slot.active:
                source.completion.request(outcome, reason)

    def advance(self, time_ns: int, image: ProcessImage) -> None:
        """Run one period, with setpoints due at ``time_ns + period_ns``."""
        self.due_ns = time_ns + self.period_ns
        if len(self._slots) > 1:
            self._hold_idle_axes(image)
        streamed = []
        for slot in self._slots:
            source = slot.select(time_ns)
            if source is not None and source.advance(time_ns, self.period_ns, image):
                self._setpoints[:, source.columns] = source.setpoint[:2]
                streamed.append(source)
        if not streamed:
            return
        try:
            self._check_late()
            self._driver.stream(self._position, self._velocity, self.due_ns)
        except LateSetpoint:  # the device has continued without it
            self.stats.late_setpoints += 1
            return
        image.setpoint[:] = self._setpoints
        self.sent_ns = self.due_ns
        for source in streamed:
            source.sent(self.due_ns)

    def device_lost(self, reason: str) -> None:
        """Fail everything that runs: the device cannot be reached. Also the watchdog's thread."""
        for slot in self._slots:
            slot.device_lost(reason)

    def _hold_idle_axes(self, image: ProcessImage) -> None:
        """Let axes that do not stream hold their command until their first setpoint.

        Another group may be streaming when a worker has just claimed these axes.
        """
        idle = image.operation != STREAMING
        np.copyto(self._position, image.position_command, where=idle)
        np.copyto(self._velocity, 0.0, where=idle)

    def _check_late(self) -> None:
        """Raise LateSetpoint where the device would not take the setpoint.

        It extrapolates, and half of the period has passed; or the setpoints that it holds have run
        dry in motion, and its path has to wait.
        """
        if self.extrapolates and self._clock.now_ns() > self.due_ns - self.period_ns // 2:
            raise LateSetpoint("more than half of the period has passed")
        if self._buffers and self._driver.stream_ran_dry(self.due_ns):
            raise LateSetpoint("the device has executed all setpoints that it held")
