"""Report of a long start-up step, for log, status and diagnostics."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from robotd.log import get_logger

log = get_logger("connection")

REPORT_INTERVAL_S = 5.0


class StartupStep:
    """Name and duration of the step that a start-up is in. Any thread reads.

    One thread at a time enters ``running``; a step within a step replaces it until it ends.
    """

    def __init__(self, report_interval_s: float = REPORT_INTERVAL_S) -> None:
        self._report_interval_s = report_interval_s
        self._step: tuple[str, float] | None = None

    @property
    def text(self) -> str:
        """Describe the running step as "starting communication for 12 s"; or ""."""
        step = self._step
        return f"{step[0]} for {time.monotonic() - step[1]:.0f} s" if step else ""

    @contextmanager
    def running(self, name: str) -> Iterator[None]:
        """The block is step ``name``; the log has a line for every ``report_interval_s`` of it."""
        before, self._step = self._step, (name, time.monotonic())
        ended = threading.Event()
        reporting = threading.Thread(
            target=self._report, args=(name, ended), name="robotd-startup-step", daemon=True
        )
        reporting.start()
        try:
            yield
        finally:
            self._step = before
            ended.set()
            reporting.join()

    def _report(self, name: str, ended: threading.Event) -> None:
        passed_s = 0.0
        while not ended.wait(self._report_interval_s):
            passed_s += self._report_interval_s
            log.warning("start-up takes long", step=name, for_s=passed_s)
