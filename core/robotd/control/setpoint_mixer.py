"""Mixes the setpoints of all sources and streams one per axis and control period."""

from __future__ import annotations

import threading
from typing import Protocol

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, Clock, MonotonicClock
from robotd.control.trajectory_execution import PREEMPTED, Outcome, TrajectoryExecution
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import Underrun
from robotd.errors import LateSetpoint

ABANDONED = "the joints did not come to rest in time"
NOT_RUNNING = "the control loop is not running"
SPLICE_LOST = "the running trajectory was stopped before this one could take over"


class SetpointSource(Protocol):
    """Source of setpoints other than a trajectory, for its own axes. Control-loop thread."""

    def advance(
        self, time_ns: int, image: ProcessImage, position: FloatArray, velocity: FloatArray
    ) -> bool:
        """Write the setpoints of its axes into the arrays; return False when it has none."""

    def device_lost(self, reason: str) -> None:
        """Handle the loss of the device; called in every period without it."""


class SetpointMixer:
    """Running trajectory execution, its successor, and the other setpoint sources.

    ``submit``, ``release_after`` and ``release`` are for the trajectory follower (one worker at
    a time); ``advance`` and ``device_lost`` for the control loop; ``add`` before it starts.

    Args:
        axes: number of axes of the device.
        rate_hz: rate of the control loop.
        clock: of the device and of the control loop; None: monotonic.

    Attributes:
        extrapolates: the device extrapolates missing setpoints; late ones are not sent then.
        late: number of setpoints that were not sent because they came too late.
    """

    def __init__(
        self, driver: AxisDriver, axes: int, rate_hz: float, clock: Clock | None = None
    ) -> None:
        self.period_ns = round(NANOSECONDS / rate_hz)
        self.late = 0
        self._driver = driver
        self._clock = clock or MonotonicClock()
        self.extrapolates = driver.underrun is Underrun.EXTRAPOLATE
        self._setpoint: FloatArray = np.full((2, axes), np.nan)
        self._position, self._velocity = self._setpoint
        self._running: TrajectoryExecution | None = None
        self._next: TrajectoryExecution | None = None
        self._due_ns = 0
        self._lost: str | None = NOT_RUNNING
        self._handover = threading.Lock()
        self._sources: list[SetpointSource] = []

    def add(self, source: SetpointSource) -> None:
        """Add a source whose setpoints are streamed together with those of trajectories."""
        self._sources.append(source)

    @property
    def running(self) -> TrajectoryExecution | None:
        """Execution that moves the joints, or holds them after its end."""
        return self._running

    @property
    def active(self) -> list[TrajectoryExecution]:
        """Running execution and its successor, without those that have ended."""
        return [each for each in (self._running, self._next) if each is not None and not each.done]

    @property
    def next_start_ns(self) -> int:
        """Earliest time 0 of a trajectory from rest that is submitted now."""
        return self._due_ns + self.period_ns

    def submit(self, execution: TrajectoryExecution, after: TrajectoryExecution | None) -> bool:
        """Run ``execution``: at once from rest, else from its ``start_ns`` on.

        The axes must be in streaming. Where the device is lost, it ends with a fault at once.

        Args:
            after: the moving execution on whose path it was planned; None: it begins at rest.

        Returns:
            False, without effect, when its start time has passed, or ``after`` is no longer the
            running one or has left its path: plan again.
        """
        with self._handover:
            if self._lost is not None:
                execution.finish(Outcome.FAULT, self._lost)
                return True
            on_path = after is None or after.on_path
            if self._running is not after or not on_path or execution.start_ns < self._due_ns:
                return False
            self._drop_next(Outcome.PREEMPTED, PREEMPTED)
            if after is None:
                self._running = execution
            else:
                self._next = execution
            return True

    def release_after(self, running: TrajectoryExecution | None) -> bool:
        """Stop holding the joints after ``running``, which has ended.

        Returns False, without effect, when another execution runs by now.
        """
        with self._handover:
            if self._running is not running:
                return False
            self._drop_next(Outcome.PREEMPTED, PREEMPTED)
            self._running = None
            return True

    def release(self) -> None:
        """Stop streaming trajectories; after the last has ended, before ``end_stream``."""
        with self._handover:
            self._drop(Outcome.FAULT, ABANDONED)

    def advance(self, time_ns: int, image: ProcessImage) -> None:
        """Run one period, with setpoints due at ``time_ns + period_ns``. Control-loop thread."""
        self._due_ns, self._lost = time_ns + self.period_ns, None
        streams = self._advance_trajectory(time_ns, image)
        for source in self._sources:
            streams |= source.advance(time_ns, image, self._position, self._velocity)
        if streams:
            self._send(self._due_ns)

    def device_lost(self, reason: str) -> None:
        """Fail everything that runs: the device cannot be reached. Control-loop thread."""
        for source in self._sources:
            source.device_lost(reason)
        self._lost = reason
        with self._handover:
            self._drop(Outcome.FAULT, reason)

    def _send(self, due_ns: int) -> None:
        """Send the setpoints, unless the device has continued without them."""
        if self.extrapolates and self._clock.now_ns() > due_ns - self.period_ns // 2:
            self.late += 1
            return
        try:
            self._driver.stream(self._position, self._velocity, due_ns)
        except LateSetpoint:
            self.late += 1
            return
        if self._running is not None:
            self._running.sent(due_ns)

    def _advance_trajectory(self, time_ns: int, image: ProcessImage) -> bool:
        if self._next is not None:
            with self._handover:
                self._take_over()
        execution = self._running
        if execution is None or execution.outcome is Outcome.FAULT:
            # After a fault the joints are at the position where the device stopped them.
            return False
        execution.advance(time_ns, self.period_ns, image)
        if not execution.streams:
            return False
        self._setpoint[:, execution.columns] = execution.setpoint
        return True

    def _take_over(self) -> None:
        """Start the successor if its time has come, or end it. Lock held."""
        successor, running = self._next, self._running
        if successor is None or running is None:
            return
        if successor.ending is not None:
            self._drop_next(*successor.ending)
        elif not running.on_path:
            self._drop_next(Outcome.FAULT, SPLICE_LOST)
        elif running.done or self._due_ns >= successor.start_ns:
            successor.take_over(running)
            running.finish(Outcome.PREEMPTED, PREEMPTED)
            self._running, self._next = successor, None

    def _drop(self, outcome: Outcome, message: str) -> None:
        self._drop_next(outcome, message)
        if self._running is not None:
            self._running.finish(outcome, message)
            self._running = None

    def _drop_next(self, outcome: Outcome, message: str) -> None:
        if self._next is not None:
            self._next.finish(outcome, message)
            self._next = None
