"""Stalls at every point of the control period, on the clock of the device."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from tests.core.control.harness import ACCELERATION, PERIOD_S, Harness

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.control.loop.setpoint_source import Outcome

TICK_S = 0.001
VELOCITY_LIMIT = 3.0
SLOW = 1e-3  # rad/s, from where a device that holds has got to back to the path
TARGET, SECONDS = [1.5, -1.5, 0.75], 2.0  # a cubic: at most 1.125 rad/s and 2.25 rad/s²
STALLED_PERIOD = 400  # in motion, at 0.8 s

Delay = Callable[[], None]


class CommandRecorder:
    """Commanded positions of the simulated drives, tick by tick."""

    def __init__(self, harness: Harness) -> None:
        self.rows: list[FloatArray] = []
        self._servo = harness.simulation.servo
        self._run = self._servo.run
        self._servo.run = self._record  # type: ignore[method-assign]

    def _record(self, tick: int, stop: int, check: Any) -> tuple[int, bool]:
        for now in range(tick, stop):
            self._run(now, now + 1, check)
            self.rows.append(self._servo.command.copy())
        return stop, False

    @property
    def velocity(self) -> FloatArray:
        return np.diff(np.array(self.rows), axis=0) / TICK_S

    @property
    def acceleration(self) -> FloatArray:
        """Mean over one control period."""
        velocity = np.array(self.rows[2:]) - np.array(self.rows[:-2])
        ticks = round(PERIOD_S / TICK_S)
        return (velocity[ticks:] - velocity[:-ticks]) / (2 * TICK_S * PERIOD_S)


def before_the_period(harness: Harness, delay: Delay) -> None:
    loop = harness.robot.control_loop
    wrap(loop, "step", before=delay)


def before_the_image_is_read(harness: Harness, delay: Delay) -> None:
    wrap(harness.mixer._driver, "read", before=delay)


def after_the_image_was_read(harness: Harness, delay: Delay) -> None:
    wrap(harness.mixer._driver, "read", after=delay)


def after_the_path_was_sampled(harness: Harness, delay: Delay) -> None:
    wrap(harness.mixer, "_check_late", before=delay)


def within_the_driver(harness: Harness, delay: Delay) -> None:
    wrap(harness.mixer._driver, "stream", before=delay)


def after_the_setpoint_was_sent(harness: Harness, delay: Delay) -> None:
    wrap(harness.mixer._driver, "stream", after=delay)


def wrap(
    target: object, name: str, before: Delay = lambda: None, after: Delay = lambda: None
) -> None:
    call = getattr(target, name)

    def wrapped(*arguments: object) -> object:
        before()
        result = call(*arguments)
        after()
        return result

    setattr(target, name, wrapped)


POINTS = [
    before_the_period,
    before_the_image_is_read,
    after_the_image_was_read,
    after_the_path_was_sampled,
    within_the_driver,
    after_the_setpoint_was_sent,
]


@pytest.fixture
def harness() -> Iterator[Harness]:
    harness = Harness().up()
    yield harness
    harness.robot.shutdown()


@pytest.mark.parametrize("stall_s", [0.0012, 0.0037, 0.08, 0.2])
@pytest.mark.parametrize("point", POINTS)
def test_no_joint_jumps_for_a_stall_at_any_point(
    harness: Harness, point: Callable[[Harness, Delay], None], stall_s: float
) -> None:
    calls = 0

    def delay() -> None:
        nonlocal calls
        calls += 1
        if calls == STALLED_PERIOD:
            now_ns = harness.clock.now_ns()
            harness.clock.sleep_until_ns(now_ns + round(stall_s * NANOSECONDS))

    recorder = CommandRecorder(harness)
    point(harness, delay)
    with harness.goal(TARGET, seconds=SECONDS) as execution:
        harness.end(execution)
    assert calls > STALLED_PERIOD
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    path = execution.trajectory.evaluate(np.linspace(0.0, SECONDS, 2000))
    velocity, direction = recorder.velocity, np.sign(TARGET)
    fastest = np.abs(path[1]).max(axis=0)
    assert (np.abs(velocity).max(axis=0) <= fastest + 0.1 * VELOCITY_LIMIT).all()
    assert (velocity * direction).min() >= -SLOW, "it ran backward"
    limit = np.abs(path[2]).max(axis=0) + ACCELERATION
    acceleration = recorder.acceleration * direction
    assert (acceleration.max(axis=0) <= limit).all()
    if stall_s < PERIOD_S:  # in a longer one the device stops, without a ramp
        assert (acceleration.min(axis=0) >= -limit).all()


@pytest.mark.parametrize("point", [after_the_path_was_sampled, within_the_driver])
def test_a_setpoint_that_is_late_is_not_sent(
    harness: Harness, point: Callable[[Harness, Delay], None]
) -> None:
    # A period that begins late has one and a half periods until its setpoint is due.
    point(harness, lambda: harness.clock.sleep_until_ns(harness.clock.now_ns() + 3_100_000))
    with harness.goal(TARGET, seconds=SECONDS):
        harness.run(0.1)
    assert harness.robot.control_loop.stats.report().late_setpoints > 10
    assert not harness.setpoints.rows


def test_a_goal_whose_first_periods_are_missed_starts_smoothly(harness: Harness) -> None:
    recorder = CommandRecorder(harness)
    with harness.goal(TARGET, seconds=SECONDS) as execution:
        harness.stall(0.08)
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED
    limit = np.abs(execution.trajectory.evaluate(np.zeros(1))[2]).max() + ACCELERATION
    assert np.abs(recorder.acceleration).max() <= limit
