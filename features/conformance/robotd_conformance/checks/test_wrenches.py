"""Wrenches: their links exist, they are renewed, and nothing is made up without communication."""

from __future__ import annotations

import time

import numpy as np
import pytest

from robotd.api import NANOSECONDS, FloatArray, WrenchDriver, read_urdf
from robotd_conformance.checks.harness import Harness

READS = 5
MAX_READ_S = 0.01


@pytest.fixture
def driver(harness: Harness) -> WrenchDriver:
    if harness.drivers.wrenches is None:
        pytest.skip("the device has no wrench of this robot")
    return harness.drivers.wrenches


def read(driver: WrenchDriver) -> tuple[FloatArray, int]:
    """Return wrenches and their time; what the driver leaves as it is, is infinite."""
    wrenches: FloatArray = np.full((len(driver.links), 6), np.inf)
    taken_ns = driver.read(wrenches)
    assert not np.isinf(wrenches).any(), f"values were not written, or are infinite: {wrenches}"
    return wrenches, taken_ns


def require_renewed(harness: Harness, driver: WrenchDriver) -> None:
    """Raise AssertionError where wrenches are not known, or do not become newer."""
    stale_s = harness.robot.descriptor.engine.stale_after_s
    before_ns = read(driver)[1]
    for _ in range(READS):
        harness.periods(max(2, round(stale_s / harness.period_s)))
        wrenches, taken_ns = read(driver)
        age_s = (harness.clock.now_ns() - taken_ns) / NANOSECONDS
        assert taken_ns > before_ns, "the time of the wrenches does not go on"
        assert 0.0 <= age_s <= stale_s, f"the wrenches are {age_s:.3f} s old, limit {stale_s:g} s"
        assert np.isfinite(wrenches).all(), "a wrench is not known while the device communicates"
        before_ns = taken_ns


@pytest.mark.clause("WrenchDriver.links/names")
def test_the_links_of_wrenches_are_those_of_the_urdf(
    harness: Harness, driver: WrenchDriver
) -> None:
    assert driver.links
    assert len(set(driver.links)) == len(driver.links), "a link is named twice"
    if harness.robot.descriptor.urdf is not None:
        unknown = set(driver.links) - set(read_urdf(harness.robot.descriptor.urdf).links)
        assert not unknown, f"the URDF has no link {', '.join(sorted(unknown))}"


@pytest.mark.clause("WrenchDriver.read/fills", "WrenchDriver.read/taken")
def test_wrenches_are_renewed_with_their_time(harness: Harness, driver: WrenchDriver) -> None:
    connection = harness.robot.connection
    require_renewed(harness, driver)
    connection.stop_communication()
    connection.start_communication()
    require_renewed(harness, driver)


@pytest.mark.clause("WrenchDriver.read/blocks")
def test_a_wrench_is_read_at_once(harness: Harness, driver: WrenchDriver) -> None:
    require_fast(driver)
    harness.robot.connection.stop_communication()
    require_fast(driver)


def require_fast(driver: WrenchDriver) -> None:
    """Raise AssertionError where even the fastest read waits."""
    took_s = []
    for _ in range(READS):
        begin_s = time.perf_counter()
        read(driver)
        took_s.append(time.perf_counter() - begin_s)
    assert min(took_s) < MAX_READ_S, f"a read takes {min(took_s):.3f} s, limit {MAX_READ_S:g} s"


@pytest.mark.clause("WrenchDriver.read/unknown")
def test_no_wrench_is_known_without_communication(harness: Harness, driver: WrenchDriver) -> None:
    for _ in range(2):
        harness.robot.connection.stop_communication()
        wrenches, _ = read(driver)
        assert np.isnan(wrenches).all(), f"wrenches are known without communication: {wrenches}"
        harness.robot.connection.start_communication()
