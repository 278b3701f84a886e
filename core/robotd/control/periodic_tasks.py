"""Tasks that the control loop calls at their own rates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from robotd.clock import NANOSECONDS
from robotd.device.process_image import ProcessImage
from robotd.log import get_logger

log = get_logger("control")

Task = Callable[[ProcessImage], None]


@dataclass
class _Periodic:
    task: Task
    name: str
    period_ns: int
    due_ns: int = 0
    failing: bool = False


class PeriodicTasks:
    """Tasks with a rate each. ``add`` by any thread, ``run`` by the control loop.

    Args:
        period_ns: of the control loop.
        image: passed to the tasks.
    """

    def __init__(self, period_ns: int, image: ProcessImage) -> None:
        self._slack_ns = period_ns // 2
        self._image = image
        self._first: list[_Periodic] = []  # before the image is read
        self._others: list[_Periodic] = []

    def add(self, rate_hz: float, name: str, task: Task, *, first: bool) -> None:
        """Add a task; ``first``: it runs before the image is read."""
        tasks = self._first if first else self._others
        tasks.append(_Periodic(task, name, round(NANOSECONDS / rate_hz)))

    def run(self, time_ns: int, *, first: bool) -> None:
        """Run the tasks due at ``time_ns``; an exception is logged once for each task."""
        for periodic in self._first if first else self._others:
            if time_ns + self._slack_ns < periodic.due_ns:
                continue
            behind = time_ns - periodic.due_ns > periodic.period_ns
            periodic.due_ns = (time_ns if behind else periodic.due_ns) + periodic.period_ns
            try:
                periodic.task(self._image)
                periodic.failing = False
            except Exception:
                if not periodic.failing:
                    log.exception("a control-loop task failed", task=periodic.name)
                periodic.failing = True
