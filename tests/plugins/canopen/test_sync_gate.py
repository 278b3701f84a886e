"""What goes out while frames may wait in an adapter that cannot discard them is bounded."""

from __future__ import annotations

import pytest

from robotd_canopen.sync_gate import CLOSING_SYNCS, MAX_PROBES, PROBE_PERIODS, SyncGate

PERIOD_S, QUIET_S = 0.01, 0.5


class Cut:
    """A gate whose bus is cut after some periods, until a period."""

    def __init__(self, heartbeat_periods: int = 0) -> None:
        self.gate = SyncGate(PERIOD_S, QUIET_S)
        self.heartbeat_periods = heartbeat_periods  # frames that are received all the same; 0: none
        self.unanswered = self.received = 0
        self.sent: list[int] = []  # periods in which SYNC was sent, since the cut

    def run(self, periods: int) -> None:
        for number in range(1, periods + 1):
            if self.heartbeat_periods and number % self.heartbeat_periods == 0:
                self.received += 1
            self.gate.advance(self.unanswered, self.received)
            if self.gate.sends:
                self.sent.append(number)
            self.unanswered += 1


def test_a_late_answer_changes_nothing() -> None:
    gate = SyncGate(PERIOD_S, QUIET_S)
    for unanswered in (0, CLOSING_SYNCS - 1, 0, CLOSING_SYNCS - 1, 0):
        gate.advance(unanswered, 0)
        assert (gate.is_closed, gate.sends) == (False, True)
        assert gate.admits(at_once=False)


@pytest.mark.parametrize("heartbeat_periods", [0, 10])
def test_the_frames_that_can_wait_are_bounded(heartbeat_periods: int) -> None:
    cut = Cut(heartbeat_periods)
    cut.run(600_000)
    assert len(cut.sent) == CLOSING_SYNCS + MAX_PROBES
    assert cut.sent[:4] == [1, 2, 2 + PROBE_PERIODS, 2 + 3 * PROBE_PERIODS]


def test_a_frame_after_a_long_silence_probes_at_once() -> None:
    cut = Cut()
    cut.run(1000)
    cut.sent.clear()
    cut.received += 1
    cut.run(1 + PROBE_PERIODS)
    assert cut.sent[0] == 1
    cut.unanswered = 0
    cut.run(1)
    assert not cut.gate.is_closed


def test_setpoints_wait_for_probes_and_what_changes_a_controlword_brings_its_own_sync() -> None:
    cut = Cut()
    cut.run(CLOSING_SYNCS + 1)
    gate = cut.gate
    assert not gate.admits(at_once=False)
    assert gate.admits(at_once=True)
    cut.sent.clear()
    cut.run(1)
    assert cut.sent == [1]
    cut.run(PROBE_PERIODS - 3)
    assert gate.admits(at_once=False), "the next SYNC is a probe"
    cut.run(1)
    assert cut.sent == [1, 1]
