"""Timing statistics of the control loop."""

from __future__ import annotations

import math

import pytest

from robotd.control.loop.period_timing import STATISTICS_PERIODS, LoopStatistics


def test_before_the_first_period_there_are_no_figures() -> None:
    report = LoopStatistics().report()
    assert (report.cycles, report.missed, report.samples) == (0, 0, 0)
    assert math.isnan(report.rate_hz)
    assert report.execution_max_us == 0.0


def test_one_period_has_no_rate() -> None:
    stats = LoopStatistics()
    stats.record(1000, 5000, 25_000)
    report = stats.report()
    assert math.isnan(report.rate_hz)
    assert report.lateness_p50_us == report.lateness_max_us == 1.0
    assert report.execution_p50_us == report.execution_max_us == 20.0


def test_percentiles_and_rate_of_known_periods() -> None:
    stats = LoopStatistics()
    for index in range(101):
        stats.record(index * 1000, index * 2_000_000, index * 2_000_000 + 2 * index * 1000)
    report = stats.report()
    assert report.samples == report.cycles == 101
    assert report.rate_hz == pytest.approx(500.0)
    assert report.lateness_p50_us == pytest.approx(50.0)
    assert report.lateness_p99_us == pytest.approx(99.0)
    assert report.lateness_max_us == pytest.approx(100.0)
    assert report.execution_p99_us == pytest.approx(198.0)


def test_figures_cover_the_window_and_the_count_every_period() -> None:
    stats = LoopStatistics()
    stats.record(10**9, 0, 10**9)
    for index in range(1, STATISTICS_PERIODS + 11):
        stats.record(0, index * 1_000_000, index * 1_000_000 + 1000)
    report = stats.report()
    assert report.cycles == STATISTICS_PERIODS + 11
    assert report.samples == STATISTICS_PERIODS
    assert report.rate_hz == pytest.approx(1000.0)
    assert report.lateness_max_us == 0.0
