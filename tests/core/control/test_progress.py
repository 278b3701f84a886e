"""Feedback of an execution: one consistent snapshot."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator

import numpy as np
import pytest
from tests.core.control.harness import PERIOD_S, Harness

from robotd.control.sources.trajectory_execution import Progress

TARGET, SECONDS = [1.5, -1.5, 0.75], 2.0
SWITCH_INTERVAL_S = 1e-5  # a period takes longer


@pytest.fixture
def often_switched() -> Iterator[None]:
    """Threads that take turns within a period."""
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    yield
    sys.setswitchinterval(before_s)


def test_the_time_of_feedback_is_that_of_the_desired_values() -> None:
    harness = Harness().up()
    with harness.goal(TARGET, seconds=SECONDS) as execution:
        for _ in range(200):
            harness.run(PERIOD_S)
            progress = execution.progress()
            planned = execution.trajectory.evaluate(np.array([progress.time_s]))
            assert progress.desired_position == pytest.approx(planned[0][0], abs=1e-9)
            assert progress.desired_velocity == pytest.approx(planned[1][0], abs=1e-9)
    harness.robot.shutdown()


@pytest.mark.usefixtures("often_switched")
def test_feedback_read_by_another_thread_is_of_one_period() -> None:
    harness, ending, seen = Harness().up(), threading.Event(), list[Progress]()
    with harness.goal(TARGET, seconds=SECONDS) as execution:

        def look() -> None:
            while not ending.is_set():
                seen.append(execution.progress())

        thread = threading.Thread(target=look)
        thread.start()
        harness.run(SECONDS / 2)
        ending.set()
        thread.join()
    harness.robot.shutdown()
    assert len({progress.time_s for progress in seen}) > 2
    for progress in seen:
        planned = execution.trajectory.evaluate(np.array([progress.time_s]))
        assert progress.desired_position == pytest.approx(planned[0][0], abs=1e-9)
        assert progress.desired_velocity == pytest.approx(planned[1][0], abs=1e-9)
