"""The age of values by the engine's own count."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from robotd_wmx.engine_time import LATEST_NS, EngineTime

CYCLE_NS = 1_000_000
START_NS = 10**12


def test_a_read_that_comes_late_does_not_make_values_young() -> None:
    time = EngineTime()
    for cycle in range(100):
        time.of(cycle, CYCLE_NS, START_NS + cycle * CYCLE_NS)
    late_ns = START_NS + 100 * CYCLE_NS + 15_000_000
    assert abs(time.of(100, CYCLE_NS, late_ns) - (START_NS + 100 * CYCLE_NS)) < 300_000


@given(st.lists(st.integers(0, 20_000_000), min_size=1, max_size=50))
def test_no_value_is_of_the_future_or_older_than_is_believed(lateness_ns: list[int]) -> None:
    time = EngineTime()
    for cycle, late_ns in enumerate(lateness_ns):
        now_ns = START_NS + cycle * CYCLE_NS + late_ns
        assert now_ns - LATEST_NS <= time.of(cycle, CYCLE_NS, now_ns) <= now_ns


def test_lost_cycles_and_a_new_count_are_found_out() -> None:
    time = EngineTime()
    time.of(1000, CYCLE_NS, START_NS)
    lost_ns = START_NS + 10 * LATEST_NS
    assert time.of(1001, CYCLE_NS, lost_ns) == lost_ns
    assert time.of(0, CYCLE_NS, lost_ns + CYCLE_NS) == lost_ns + CYCLE_NS


def test_a_clock_that_is_slower_is_followed() -> None:
    time = EngineTime()
    for cycle in range(20_000):
        now_ns = START_NS + cycle * (CYCLE_NS + 100)  # 100 ppm
        assert now_ns - time.of(cycle, CYCLE_NS, now_ns) < 10_000
