"""Wall-clock time of a tap, on a computer whose clock is set."""

from __future__ import annotations

import time
from types import SimpleNamespace

import pytest

from robotd.clock import NANOSECONDS, Clock, MonotonicClock
from robotd.clock.simulated import SteppedClock
from robotd.observation import tap as tap_module
from robotd.observation.tap import Tap
from robotd.robot import build_robot

SET_S = 1e6  # as by NTP on a computer without a battery


@pytest.mark.parametrize(("clock", "shift_s"), [(MonotonicClock(), SET_S), (SteppedClock(), 0.0)])
def test_a_clock_that_is_set_counts_in_real_time(
    monkeypatch: pytest.MonkeyPatch, clock: Clock, shift_s: float
) -> None:
    tap = Tap(build_robot("cr3a", "sim", clock=clock), 5.0)
    before_ns = tap.offset_ns
    later_ns = time.time_ns() + round(SET_S * NANOSECONDS)
    monkeypatch.setattr(tap_module, "time", SimpleNamespace(time_ns=lambda: later_ns))
    shift_ns = tap.offset_ns - before_ns
    assert shift_ns / NANOSECONDS == pytest.approx(shift_s, abs=1000.0)
