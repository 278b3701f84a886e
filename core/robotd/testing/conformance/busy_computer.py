"""Further attempts of checks in real time that failed while the computer was busy."""

from __future__ import annotations

from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol

from robotd.testing.conformance.kit_target import KitTarget

ATTEMPTS = 3
BUSY_S = 0.03  # for which the check waited for a processor


class BusyComputer:
    """A plugin of pytest that repeats a failed check, up to ``ATTEMPTS`` times.

    Only in real time, and only when the thread of the check waited for a processor: then so did
    the control loop, and simulated drives. A fault of the backend fails every attempt.

    Attributes:
        repeated: names of the checks that were repeated.
    """

    def __init__(self, target: KitTarget) -> None:
        self._target = target
        self.repeated: list[str] = []

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> bool:
        """Run the check, and report its last attempt."""
        reports: list[pytest.TestReport] = []
        where = {"nodeid": item.nodeid, "location": item.location}
        item.ihook.pytest_runtest_logstart(**where)
        for attempt in range(ATTEMPTS):
            self._target.real_time = not self._target.lives_by_clock
            began_s = processor_wait_s()
            reports = runtestprotocol(item, log=False, nextitem=nextitem)
            busy = self._target.real_time and processor_wait_s() - began_s > BUSY_S
            if not (busy and any(report.failed for report in reports)):
                break
            if attempt == 0:
                self.repeated.append(item.name)
            self._target.clear()
        for report in reports:
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(**where)
        return True


def processor_wait_s() -> float:
    """Return the time that this thread has waited for a processor; 0.0: unknown."""
    try:
        fields = Path("/proc/thread-self/schedstat").read_text(encoding="ascii").split()
    except OSError:
        return 0.0
    return int(fields[1]) * 1e-9
