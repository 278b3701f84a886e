"""Streams what moves the axes, one setpoint per axis and period: a trajectory, and more."""

from __future__ import annotations

import threading
from typing import Protocol

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.clock import NANOSECONDS
from robotd.cycle.execution import Execution, Outcome
from robotd.device.drivers import AxisDriver
from robotd.device.image import ProcessImage

PREEMPTED = "preempted by a new goal"
SPLICE_LOST = "the running trajectory was stopped before this one could take over"


class SetpointSource(Protocol):
    """Something besides trajectories that moves axes of its own. Cycle thread."""

    def advance(
        self, time_ns: int, image: ProcessImage, position: FloatArray, velocity: FloatArray
    ) -> bool:
        """Write the setpoints of its axes into the arrays; False when it moves nothing now."""

    def device_lost(self, reason: str) -> None:
        """The device cannot be reached. Called in every such period."""


class Streamer:
    """Holds at most one running execution and one that takes over at its start time.

    ``submit`` and ``release`` are for the trajectory follower (one worker at a time);
    ``advance`` and ``device_lost`` for the cycle; ``add`` comes before the cycle starts.

    Args:
        axes: number of axes of the device.
        rate_hz: rate of the cycle.
    """

    def __init__(self, driver: AxisDriver, axes: int, rate_hz: float) -> None:
        self.period_ns = round(NANOSECONDS / rate_hz)
        self._driver = driver
        self._position: FloatArray = np.full(axes, np.nan)
        self._velocity: FloatArray = np.full(axes, np.nan)
        self._axes: IntArray = np.zeros(0, np.int64)
        self._running: Execution | None = None
        self._next: Execution | None = None
        self._handover = threading.Lock()
        self._sources: list[SetpointSource] = []

    def add(self, source: SetpointSource) -> None:
        """Stream the setpoints of ``source`` together with those of trajectories."""
        self._sources.append(source)

    @property
    def running(self) -> Execution | None:
        """The execution that moves the joints now, or holds them after its end."""
        return self._running

    @property
    def active(self) -> list[Execution]:
        """What runs and what is waiting to take over, without what has ended."""
        return [each for each in (self._running, self._next) if each is not None and not each.done]

    def submit(self, execution: Execution, axes: IntArray) -> None:
        """Let ``execution`` take over at its ``start_ns``. The axes must be in streaming."""
        with self._handover:
            if self._next is not None:
                self._next.finish(Outcome.PREEMPTED, PREEMPTED)
            self._axes, self._next = axes, execution

    def release(self) -> None:
        """Stream no more. Call after the last execution ended and before ``end_stream``."""
        self._running = None

    def advance(self, time_ns: int, image: ProcessImage) -> None:
        """Cycle: one period, whose setpoints are due at ``time_ns + period_ns``."""
        streams = self._advance_trajectory(time_ns, image)
        for source in self._sources:
            streams |= source.advance(time_ns, image, self._position, self._velocity)
        if streams:
            self._driver.stream(self._position, self._velocity)

    def device_lost(self, reason: str) -> None:
        """Cycle: the device cannot be reached; whatever runs has failed."""
        for source in self._sources:
            source.device_lost(reason)
        if self._next is None and self._running is None:
            return
        with self._handover:
            for execution in (self._next, self._running):
                if execution is not None:
                    execution.finish(Outcome.FAULT, reason)
            self._next = None

    def _advance_trajectory(self, time_ns: int, image: ProcessImage) -> bool:
        self._take_over(time_ns)
        execution = self._running
        if execution is None or execution.outcome is Outcome.FAULT:
            # After a fault the joints are where the device stopped them, not at the setpoint.
            return False
        execution.advance(time_ns, self.period_ns, image)
        if not execution.streams:
            return False
        self._position[self._axes] = execution.position
        self._velocity[self._axes] = execution.velocity
        return True

    def _take_over(self, time_ns: int) -> None:
        if self._next is None:
            return
        with self._handover:
            successor, running = self._next, self._running
            if successor.ending:
                successor.finish(*successor.ending)
                self._next = None
            elif time_ns >= successor.start_ns:
                self._next = None
                if running is not None and running.ending and not running.done:
                    successor.finish(Outcome.FAULT, SPLICE_LOST)
                    return
                if running is not None:
                    running.finish(Outcome.PREEMPTED, PREEMPTED)
                self._running = successor
