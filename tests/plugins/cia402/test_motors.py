"""Clock of the simulated motors: locked to SYNC, or that of the computer without it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotd.api import Segment
from robotd_cia402.simulated.motors import Motors

PERIOD_S, PERIOD_NS = 0.004, 4_000_000


@given(st.integers(0, PERIOD_NS), st.integers(0, PERIOD_NS - 1))
def test_a_late_sync_is_one_period_also_after_a_time_without_sync(
    silent_ns: int, late_ns: int
) -> None:
    """The time without SYNC ends at any phase; the grid is that of the SYNCs, not of this phase."""
    motors = Motors([0.0], 0)
    motors.free_run(silent_ns)
    motors.plan(0, [Segment(0.0, 0.0, 1.0, 0.0)])
    motors.synchronise(2 * PERIOD_NS, PERIOD_S)
    begin = motors.command(0)[0]
    for number in (3, 4):
        motors.synchronise(number * PERIOD_NS, PERIOD_S)
    motors.synchronise(5 * PERIOD_NS + late_ns, PERIOD_S)
    assert motors.command(0)[0] - begin == pytest.approx(3 * PERIOD_S)
