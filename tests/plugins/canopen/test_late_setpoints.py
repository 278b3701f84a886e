"""Setpoints of a period that was interrupted: rejected when the drives have come to rest."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from tests.fakes import FakeClock
from tests.plugins.canopen.network import options, plan

from robotd.descriptor import RobotDescriptor
from robotd.device.process_image import ProcessImage
from robotd.device.state import ConnectionState, Operation
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
        self.before_sync_s = self.in_send_s = self.after_sync_s = (
            0.0  # for which the process is stopped
        )
        self.master.bus.send = self._send  # type: ignore[method-assign]
        self.due_ns = self.clock.now_ns()

    def _send(self, frame: Frame) -> bool:
        self.clock.advance(self.in_send_s)
        self.in_send_s = 0.0
        return True

    def period(self) -> None:
        """One period from its nominal time on, as the control loop runs it."""
        self.clock.sleep_until_ns(self.due_ns)
        self.due_ns += PERIOD_NS
        self.clock.advance(self.before_sync_s)
        self.master.sync.send()
        self.clock.advance(self.after_sync_s)
        self.master.stream(np.zeros(2), np.zeros(2), self.due_ns)


@pytest.fixture
def harness() -> Harness:
    made = Harness()
    for _ in range(5):
        made.period()
    return made


def test_a_setpoint_after_a_sync_that_was_late_is_rejected(harness: Harness) -> None:
    harness.before_sync_s = STOPPED_S
    with pytest.raises(LateSetpoint):
        harness.period()


def test_a_stop_while_sync_is_sent_counts_as_one_after_it(harness: Harness) -> None:
    """The frame may have left: without the setpoint the drives would go back."""
    harness.in_send_s = STOPPED_S
    harness.period()


def test_the_drives_count_from_the_nominal_time_of_the_sync_before(harness: Harness) -> None:
    """It was sent 1.5 ms late, so that less than two periods lie between the two."""
    harness.before_sync_s = 0.0015
    harness.period()
    harness.before_sync_s = 0.0052
    with pytest.raises(LateSetpoint):
        harness.period()


def test_a_sync_at_the_end_of_a_missed_period_waits_until_its_count_is_clear(
    harness: Harness,
) -> None:
    harness.before_sync_s = 0.9999 * PERIOD_NS * 1e-9
    with pytest.raises(LateSetpoint):
        harness.period()
    assert harness.master.sync.periods == 2
    assert harness.clock.now_ns() - harness.due_ns == pytest.approx(0.1 * PERIOD_NS, abs=1000)


def test_a_setpoint_that_is_late_after_its_sync_is_sent(harness: Harness) -> None:
    """The drives have gone on to where it is."""
    harness.after_sync_s = STOPPED_S
    harness.period()


def test_the_first_setpoint_after_skipped_periods_is_sent(harness: Harness) -> None:
    """It was made for where the drives hold."""
    harness.due_ns += 10 * PERIOD_NS
    harness.period()
    assert harness.master.timing.after_rest


@pytest.mark.parametrize("cycles", [1, 2])
def test_each_sync_has_its_frames_where_no_setpoint_came(
    monkeypatch: pytest.MonkeyPatch, cycles: int
) -> None:
    """A stop of another axis goes on, and a servo is switched off."""
    robot = RobotDescriptor.model_validate(
        {"schema": 1, "name": "test", "axes": 2, "cycle": {"rate_hz": 250}}
    )
    master = Master(robot, plan(options(sync_period_s=0.004 * cycles)), FakeClock())
    sent, image = list[int](), ProcessImage(2)
    monkeypatch.setattr(master.bus, "send", lambda frame: sent.append(frame.arbitration_id))
    monkeypatch.setattr(master, "_state", ConnectionState.COMMUNICATING)
    monkeypatch.setattr(master, "stream_problem", lambda _: "")
    for axis in master.axes:
        axis.drive.node.configured = True
        monkeypatch.setattr(axis, "observe", lambda _: None)
    master.axes[0].activity.begin(Operation.STREAM)
    for _ in range(12):
        master.read(image)
    syncs = [place for place, cob_id in enumerate(sent) if cob_id == 0x080]
    frames = [sent[before:after] for before, after in pairwise(syncs)]
    assert len(frames) >= 5
    assert all({0x201, 0x202} <= set(between) for between in frames)
