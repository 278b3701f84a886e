"""Stops that the device does not take at once: they go on until rest is measured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from tests.core.control.harness import FAR, PERIOD_S, RATE_HZ, Harness

from robotd.clock import NANOSECONDS
from robotd.control.groups.problem import ProblemKind
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Axes
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.errors import DeviceTimeout, NotReady, OperationError

SPEED_RAD_S = 0.1


class OnDevice:
    """Simulated arm whose driver interpolates: joint 1 moves on until a stop is taken.

    Attributes:
        busy: number of stops that are rejected yet; inf: all.
        rejected: number of stops that were.
    """

    def __init__(self, harness: Harness, busy: float) -> None:
        self.busy, self.rejected, self._harness = busy, 0, harness
        self._driver = driver = harness.robot.axes._driver
        self._stop, self._quick_stop = driver.stop, driver.quick_stop
        driver.follow = self.follow  # type: ignore[method-assign]
        driver.stop = self.stop  # type: ignore[method-assign]
        driver.quick_stop = self.quick_stop  # type: ignore[method-assign]
        driver.stop_trajectory = lambda axes, _: self.stop(axes)  # type: ignore[method-assign]
        harness.robot.control_loop.every(RATE_HZ, "device", self._advance)

    def follow(self, axes: Sequence[int], *_: object) -> None:
        self._driver.begin_stream(axes)

    def stop(self, axes: Sequence[int]) -> None:
        self._check()
        self._stop(axes)

    def quick_stop(self, axes: Sequence[int]) -> None:
        self._check()
        self._quick_stop(axes)

    def _check(self) -> None:
        if self.busy:
            self.busy -= 1
            self.rejected += 1
            raise OperationError("busy")

    def _advance(self, image: ProcessImage) -> None:
        if image.operation[0] == Operation.STREAM:
            position, velocity = image.position_command.copy(), np.zeros(image.axes)
            velocity[0] = SPEED_RAD_S
            position[0] += SPEED_RAD_S * PERIOD_S
            due_ns = image.stamp_ns + round(PERIOD_S * NANOSECONDS)
            self._driver.stream(position, velocity, due_ns)


@pytest.fixture
def harness(monkeypatch: pytest.MonkeyPatch) -> Iterator[Harness]:
    monkeypatch.setattr(Axes, "trajectories_on_device", True)
    harness = Harness().up()
    yield harness
    harness.robot.shutdown()


def unconfirmed(harness: Harness) -> list[str]:
    found = harness.robot.find_problems()
    return [problem.text for problem in found if problem.kind is ProblemKind.NOT_STOPPED]


def assert_stands(harness: Harness) -> None:
    before = harness.faults.position(0)
    harness.run(1.0)
    assert harness.faults.position(0) == pytest.approx(before, abs=1e-4)
    assert harness.image.operation.tolist() == [Operation.IDLE] * 3


@pytest.mark.parametrize("busy", [1, 2, 5])
def test_the_operators_stop_ends_at_rest_although_the_device_was_busy(
    harness: Harness, busy: int
) -> None:
    device = OnDevice(harness, busy)
    with harness.goal(FAR) as execution:
        harness.until(lambda: harness.faults.position(0) > 0.05)
        harness.robot.stop()
        assert device.rejected == busy
        assert_stands(harness)
        assert execution.outcome is Outcome.STOPPED
    harness.robot.reset()
    assert unconfirmed(harness) == []


def test_a_canceled_goal_comes_to_rest_although_the_device_was_busy(harness: Harness) -> None:
    OnDevice(harness, 1)
    with harness.goal(FAR) as execution:
        harness.until(lambda: harness.faults.position(0) > 0.05)
        execution.cancel()
        harness.end(execution)
    assert execution.outcome is Outcome.CANCELED
    assert_stands(harness)


def test_a_stop_that_the_device_never_takes_is_said_and_goes_on(harness: Harness) -> None:
    device = OnDevice(harness, np.inf)
    with harness.goal(FAR) as execution:
        harness.until(lambda: harness.faults.position(0) > 0.05)
        with pytest.raises(DeviceTimeout, match=r"joint1.*: not at rest after"):
            harness.robot.stop()
        harness.end(execution)
        assert execution.message.endswith("joints still move")
    assert any("joint1: its stop is not confirmed: busy" in text for text in unconfirmed(harness))
    with pytest.raises(DeviceTimeout, match="axes still move"):
        harness.robot.reset()
    with pytest.raises(NotReady), harness.goal(FAR):
        pass
    device.busy = 0
    harness.run(1.5)
    assert_stands(harness)
    assert unconfirmed(harness) == []
    assert "allowed again" in harness.robot.reset()


def test_a_device_that_is_lost_is_asked_again(harness: Harness) -> None:
    device = OnDevice(harness, 2)
    with harness.goal(FAR) as execution:
        harness.until(lambda: harness.faults.position(0) > 0.05)
        harness.faults.freeze(True)
        harness.run(1.0)
        assert (execution.outcome, device.busy) == (Outcome.FAULT, 0)
        harness.faults.freeze(False)
        harness.run(1.0)
        assert_stands(harness)
