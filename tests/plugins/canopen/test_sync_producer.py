"""The even grid of the SYNCs, whatever the computer does."""

from __future__ import annotations

from typing import cast

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.fakes import FakeClock

from robotd_canopen.bus import Bus
from robotd_canopen.frame import Frame
from robotd_canopen.master import SyncProducer
from robotd_cia402.sync_timing import SyncTiming

PERIOD_NS = 4_000_000
START_NS = 10**12
LATE_NS = 500_000  # late enough to be sent at once after missed periods
EASED_NS = LATE_NS // 256  # by so much a late SYNC moves the grid


class Wire:
    """A bus that keeps what was sent."""

    def __init__(self) -> None:
        self.sent: list[Frame] = []

    def send(self, message: Frame) -> bool:
        self.sent.append(message)
        return True

    def measure_load(self, now_ns: int) -> None:
        pass


class Producer(SyncProducer):
    """A producer that sends at given times."""

    def __init__(self, wire: Wire | None = None) -> None:
        self.clock = FakeClock(START_NS)
        super().__init__(cast(Bus, wire or Wire()), self.clock, PERIOD_NS * 1e-9, 0.1, 127)

    def send_at(self, time_ns: int) -> int:
        """Send SYNC at ``time_ns`` or, where that is not clear, later; return the time."""
        self.clock.sleep_until_ns(time_ns)
        self.send()
        return self.clock.now_ns()


@given(st.lists(st.integers(0, PERIOD_NS * 9 // 10 - 1), min_size=1, max_size=50))
def test_late_syncs_do_not_bend_the_grid(late_ns: list[int]) -> None:
    sync = Producer()
    sync.send_at(START_NS)  # one that is not late at all
    total_late_ns = 0
    for number, late in enumerate(late_ns, 1):
        nominal_ns = START_NS + number * PERIOD_NS
        sync.send_at(nominal_ns + late)
        total_late_ns += late
        assert (
            0 <= sync.timing.time_ns - nominal_ns <= total_late_ns / 256
        )  # by so much each eases it
        assert sync.periods == 1


@given(st.integers(1, 20))
def test_syncs_that_were_left_out_count_as_periods(periods: int) -> None:
    sync = Producer()
    sync.send_at(START_NS)
    sync.send_at(START_NS + periods * PERIOD_NS + LATE_NS)
    assert sync.periods == periods
    assert sync.timing.time_ns == pytest.approx(START_NS + periods * PERIOD_NS, abs=EASED_NS)


@given(
    st.lists(st.tuples(st.integers(0, 5), st.integers(0, PERIOD_NS // 2)), max_size=50),
    st.data(),
)
def test_drives_count_the_periods_as_the_producer_does(
    stalls: list[tuple[int, int]], data: st.DataObject
) -> None:
    """They see each SYNC a little later, so that periods end earlier or later for them."""
    sync, drive = Producer(), SyncTiming(PERIOD_NS)
    sync.send_at(START_NS)
    drive.note_event(START_NS + 20_000)
    begin_ns = START_NS
    for missed, late_ns in stalls:
        begin_ns += (1 + missed) * PERIOD_NS
        sent_ns = sync.send_at(begin_ns + late_ns)
        latency_ns = data.draw(st.integers(20_000, 150_000))
        assert drive.note_event(sent_ns + latency_ns) == sync.periods


def test_a_sync_close_behind_a_late_one_is_none_of_its_own() -> None:
    sync = Producer()
    sync.send_at(START_NS)
    sync.send_at(START_NS + 2 * PERIOD_NS + LATE_NS)
    assert sync.periods == 2
    sync.send_at(START_NS + 2 * PERIOD_NS + LATE_NS + 100_000)
    assert sync.periods == 0
    assert sync.timing.time_ns == pytest.approx(START_NS + 2 * PERIOD_NS, abs=EASED_NS)
    sync.send_at(START_NS + 3 * PERIOD_NS)
    assert (sync.periods, sync.timing.time_ns) == (1, START_NS + 3 * PERIOD_NS)


def test_a_grid_that_began_late_comes_to_those_that_follow() -> None:
    sync = Producer()
    sync.send_at(START_NS + 5 * PERIOD_NS // 8)
    for number in range(1, 2000):
        sync.send_at(START_NS + number * PERIOD_NS)
    assert sync.timing.time_ns == pytest.approx(START_NS + 1999 * PERIOD_NS, abs=2000)


def test_an_earlier_sync_moves_a_grid_that_began_late() -> None:
    sync = Producer()
    sync.send_at(START_NS + 900_000)
    sync.send_at(START_NS + PERIOD_NS)
    assert (sync.periods, sync.timing.time_ns) == (1, START_NS + PERIOD_NS)
    assert sync.jitter_ns == 900_000


def test_a_pause_of_communication_is_no_jitter() -> None:
    sync = Producer()
    sync.send_at(START_NS)
    sync.begin()
    sync.send_at(START_NS + 1000 * PERIOD_NS + LATE_NS)
    sync.send_at(START_NS + 1001 * PERIOD_NS + LATE_NS)
    assert sync.jitter_ns == 0
    assert sync.before_ns == pytest.approx(START_NS + 1000 * PERIOD_NS, abs=EASED_NS)


def test_the_heartbeat_goes_out_when_it_is_due() -> None:
    wire = Wire()
    sync = Producer(wire)
    for number in range(51):
        sync.send_at(START_NS + number * PERIOD_NS)
    beats = [frame for frame in wire.sent if frame.arbitration_id == 0x700 + 127]
    assert [bytes(beat.data) for beat in beats] == [b"\x05"] * 3
