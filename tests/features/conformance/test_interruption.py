"""Stop signals during the checks."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import suppress

import pytest

from robotd_conformance.checks.interruption import InterruptOnce


@pytest.fixture
def interruption() -> Iterator[InterruptOnce]:
    interruption = InterruptOnce()
    restore = interruption.install()
    yield interruption
    restore()


def test_a_signal_counts_where_its_exception_was_swallowed(interruption: InterruptOnce) -> None:
    interruption.between_checks()
    with suppress(KeyboardInterrupt):  # as Python does in a finalizer
        signal.raise_signal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt):
        interruption.between_checks()


def test_a_signal_during_a_shutdown_counts_at_its_end(interruption: InterruptOnce) -> None:
    steps = []

    def shut_down() -> None:
        with interruption.during_shutdown():
            signal.raise_signal(signal.SIGTERM)
            steps.append("ended")

    with pytest.raises(KeyboardInterrupt):
        shut_down()
    assert steps == ["ended"]
