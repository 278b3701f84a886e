"""Setpoints of a period that was interrupted: rejected when the drives have come to rest."""

from __future__ import annotations

import pytest
from tests.unit.canopen.network import options, plan

from robotd.clock import FakeClock
from robotd.descriptor import RobotDescriptor
from robotd.errors import LateSetpoint
from robotd_canopen.frame import Frame
from robotd_canopen.master import Master

PERIOD_NS = 4_000_000
STOPPED_S = 0.03


class Harness:
    """Master whose bus is the test; periods of ``run`` are SYNC and setpoints."""

    def __init__(self) -> None:
        self.clock = FakeClock()
        robot = RobotDescriptor.model_validate({"schema": 1, "name": "test", "axes": 2})
        self.master = Master(robot, plan(options()), self.clock)
        self.stopped_before_sync = self.stopped_after_sync = False
        self.master.bus.send = self._send  # type: ignore[method-assign]
        self.due_ns = self.clock.now_ns()

    def _send(self, frame: Frame) -> bool:
        return True

    def period(self) -> None:
        """One period from its nominal time on, as the control loop runs it."""
        self.clock.sleep_until_ns(self.due_ns)
        self.due_ns += PERIOD_NS
        now_ns = self.clock.now_ns()
        if self.stopped_before_sync:
            self.clock.advance(STOPPED_S)
        self.master.sync.note_start(self.clock.now_ns())
        self.master.sync.send(now_ns)
        if self.stopped_after_sync:
            self.clock.advance(STOPPED_S)
        self.master.stream([0.0, 0.0], [0.0, 0.0], self.due_ns)


@pytest.fixture
def harness() -> Harness:
    made = Harness()
    for _ in range(5):
        made.period()
    return made


def test_a_setpoint_after_a_sync_that_was_late_is_rejected(harness: Harness) -> None:
    harness.stopped_before_sync = True
    with pytest.raises(LateSetpoint):
        harness.period()


def test_a_setpoint_that_is_late_after_its_sync_is_sent(harness: Harness) -> None:
    """The drives have gone on to where it is."""
    harness.stopped_after_sync = True
    harness.period()


def test_the_first_setpoint_after_skipped_periods_is_sent(harness: Harness) -> None:
    """It was made for where the drives hold."""
    harness.due_ns += 10 * PERIOD_NS
    harness.period()
    assert harness.master.sync.after_rest
