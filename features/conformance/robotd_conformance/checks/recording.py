"""Recording of the process image, period by period, as arrays."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import cached_property

import numpy as np

from robotd.api import FloatArray, ProcessImage

LATE_PERIODS = 1.4  # from one sample to the next
RECORDED = ("position", "velocity", "position_command", "velocity_command", "servo_on")


def _column(name: str) -> cached_property[FloatArray]:
    """Attribute of a ``Recording`` with the samples of one array of the process image."""
    return cached_property(lambda recording: np.array(recording._rows[name], np.float64))  # noqa: SLF001


class Recording:
    """Samples in the order of time; every array has the shape (samples, n_axes).

    Look at it when the recording is over. Samples whose values are as old as the one before
    are left out: they say nothing new.
    """

    def __init__(self) -> None:
        self._times_ns: list[int] = []
        self._rows: dict[str, list[np.ndarray]] = {name: [] for name in RECORDED}

    def __len__(self) -> int:
        return len(self._times_ns)

    def add(self, image: ProcessImage) -> None:
        if not self._times_ns or image.fresh_ns > self._times_ns[-1]:
            self._times_ns.append(image.fresh_ns)
            for name, rows in self._rows.items():
                rows.append(getattr(image, name).copy())

    @cached_property
    def time_s(self) -> FloatArray:
        """(samples,) when the device had the values, from the first sample on."""
        times_ns = np.array(self._times_ns, np.int64)
        return np.asarray((times_ns - times_ns[:1].sum()) * 1e-9, np.float64)

    position = _column("position")
    velocity = _column("velocity")
    position_command = _column("position_command")
    velocity_command = _column("velocity_command")
    servo_on = _column("servo_on")

    def was_late(self, period_s: float) -> bool:
        """Some values came late, so that those of a period are missing."""
        return bool(np.diff(self.time_s).max(initial=0.0) > LATE_PERIODS * period_s)

    def slope(self, values: FloatArray, span_s: float) -> tuple[FloatArray, FloatArray]:
        """Mean rate of change over spans of ``span_s``: times (k,), and rates (k, n_axes)."""
        ends = np.searchsorted(self.time_s, self.time_s + span_s)
        first = np.flatnonzero(ends < len(self.time_s))
        last = ends[first]
        spans = self.time_s[last] - self.time_s[first]
        middles = (self.time_s[last] + self.time_s[first]) / 2
        return middles, (values[last] - values[first]) / spans[:, None]


class Recorder:
    """Control-loop task that fills the current recording, if any.

    What has been taken away is used no more when the method returns.
    """

    def __init__(self) -> None:
        self._in_use = threading.Lock()
        self._sink: Recording | None = None
        self._task: Callable[[ProcessImage], None] | None = None

    def fill(self, sink: Recording | None) -> None:
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
