"""Recording of the process image, period by period, as arrays."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import cached_property

import numpy as np

from robotd.api import FloatArray, ProcessImage

LATE_PERIODS = 1.4  # from one sample to the next
PAUSE_PERIODS = 1.6  # of the control loop; after 2 ``ProfiledAxes`` have come to rest
RECORDED = ("position", "velocity", "position_command", "velocity_command", "servo_on")


def _column(name: str) -> cached_property[FloatArray]:
    """Attribute of a ``MotionSamples`` with the samples of one array of the process image."""
    return cached_property(lambda recording: np.array(recording._rows[name], np.float64))  # noqa: SLF001


class MotionSamples:
    """Samples in the order of time; every array has the shape (samples, n_axes).

    Look at it when the recording is over. Samples whose values are as old as the one before
    are left out: they say nothing new.

    Args:
        period_s: of the control loop.
        slow: values arrive less often than control periods begin: commands are newer than values.
    """

    def __init__(self, period_s: float, *, slow: bool) -> None:
        self._period_s, self._slow = period_s, slow
        self._times_ns: list[int] = []
        self._stamps_ns: list[int] = []
        self._stamp_ns = self._longest_ns = 0
        self._rows: dict[str, list[np.ndarray]] = {name: [] for name in RECORDED}

    def __len__(self) -> int:
        return len(self._times_ns)

    def add(self, image: ProcessImage) -> None:
        if self._stamp_ns:
            self._longest_ns = max(self._longest_ns, image.stamp_ns - self._stamp_ns)
        self._stamp_ns = image.stamp_ns
        if not self._times_ns or image.fresh_ns > self._times_ns[-1]:
            self._times_ns.append(image.fresh_ns)
            self._stamps_ns.append(image.stamp_ns)
            for name, rows in self._rows.items():
                rows.append(getattr(image, name).copy())

    @cached_property
    def time_s(self) -> FloatArray:
        """(samples,) when the device had the values, from the first sample on."""
        return self._since_first(self._times_ns)

    @cached_property
    def command_time_s(self) -> FloatArray:
        """(samples,) when the commands were computed, as ``time_s``."""
        return self._since_first(self._stamps_ns if self._slow else self._times_ns)

    def _since_first(self, times_ns: list[int]) -> FloatArray:
        times, first_ns = np.array(times_ns, np.int64), sum(self._times_ns[:1])
        return np.asarray((times - first_ns) * 1e-9, np.float64)

    position = _column("position")
    velocity = _column("velocity")
    position_command = _column("position_command")
    velocity_command = _column("velocity_command")
    servo_on = _column("servo_on")

    def was_late(self, period_s: float) -> bool:
        """Some values came late, so that those of a period are missing; or a command did."""
        paused = self._slow and self._longest_ns * 1e-9 > PAUSE_PERIODS * self._period_s
        return paused or bool(np.diff(self.time_s).max(initial=0.0) > LATE_PERIODS * period_s)

    def slope(
        self, values: FloatArray, span_s: float, *, commanded: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Mean rate of change over spans of ``span_s``: times (k,), and rates (k, n_axes).

        Args:
            values: (samples, n_axes).
            commanded: they are commands, or follow from them.
        """
        times_s = self.command_time_s if commanded else self.time_s
        ends = np.searchsorted(times_s, times_s + span_s)
        first = np.flatnonzero(ends < len(times_s))
        last = ends[first]
        spans = times_s[last] - times_s[first]
        middles = (times_s[last] + times_s[first]) / 2
        return middles, (values[last] - values[first]) / spans[:, None]


class MotionRecorder:
    """Control-loop task that fills the current recording, if any.

    What has been taken away is used no more when the method returns.
    """

    def __init__(self) -> None:
        self._in_use = threading.Lock()
        self._sink: MotionSamples | None = None
        self._task: Callable[[ProcessImage], None] | None = None

    def fill(self, sink: MotionSamples | None) -> None:
        with self._in_use:
            self._sink = sink

    def call(self, task: Callable[[ProcessImage], None] | None) -> None:
        with self._in_use:
            self._task = task

    def __call__(self, image: ProcessImage) -> None:
        with self._in_use:
            if self._sink is not None:
                self._sink.add(image)
            if self._task is not None:
                self._task(image)
