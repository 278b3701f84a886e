"""Time limit of a check: a hang fails it, a computer that is busy makes it inconclusive."""

from __future__ import annotations

import time

import pytest

from robotd_conformance.checks import time_limits
from robotd_conformance.checks.inconclusive import UNDECIDED

LIMIT_S, PATIENCE_S = 0.2, 0.6


@pytest.fixture(autouse=True)
def short_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time_limits, "CHECK_LIMIT_S", LIMIT_S)
    monkeypatch.setattr(time_limits, "PATIENCE_S", PATIENCE_S)


def hang(monkeypatch: pytest.MonkeyPatch, busy: float) -> float:
    """Hang in a check, on a computer that has it wait for this share of the time; duration."""
    began_s = time.monotonic()
    monkeypatch.setattr(
        time_limits, "longest_wait_s", lambda before_s: busy * (time.monotonic() - began_s)
    )
    try:
        with time_limits._limited("the check"):
            time.sleep(30.0)
    finally:
        duration_s = time.monotonic() - began_s
    return duration_s


def test_a_hang_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(pytest.fail.Exception, match=r"the check did not end within 0\.2 s"):
        hang(monkeypatch, 0.0)


def test_time_in_the_queue_of_a_processor_is_granted(monkeypatch: pytest.MonkeyPatch) -> None:
    began_s = time.monotonic()
    with pytest.raises(pytest.fail.Exception):
        hang(monkeypatch, 0.5)
    assert time.monotonic() - began_s > 1.4 * LIMIT_S


def test_what_hardly_got_a_processor_is_inconclusive(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(pytest.skip.Exception, match=f"{UNDECIDED}, load .* processors; seen"):
        hang(monkeypatch, 0.9)


def test_waiting_threads_are_counted() -> None:
    before_s = time_limits.queue_times_s()
    if not before_s:
        pytest.skip("this system does not count them")
    assert 0.0 <= time_limits.longest_wait_s(before_s) < 60.0
