"""Streams whose motion an object decides in each period, on the simulation."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from tests.core.control.harness import ACCELERATION, Harness

from robotd.api import FloatArray, InvalidArgument
from robotd.control.loop.setpoint_source import Outcome
from robotd.motion import JointLimits


class Climb:
    """All joints with one velocity, which changes with a fixed acceleration."""

    def __init__(self) -> None:
        self.begun = 0
        self.stops = 0
        self.broken = False
        self.deaf = False

    def begin(self, setpoint: FloatArray, limits: JointLimits, period_s: float) -> None:
        self.begun += 1
        self.setpoint, self.period_s = setpoint, period_s
        self.target = 0.0

    def take(self, command: float) -> None:
        self.target = command

    def stop(self) -> None:
        self.stops += 1
        if not self.deaf:
            self.target = 0.0

    def advance(self) -> FloatArray:
        if self.broken:
            raise RuntimeError("lost")
        position, velocity, _ = self.setpoint
        step = 0.2 * ACCELERATION * self.period_s
        change = np.clip(self.target - velocity, -step, step)
        position = position + self.period_s * (velocity + 0.5 * change)
        self.setpoint = np.array([position, velocity + change, change / self.period_s])
        return self.setpoint


@pytest.fixture
def robot() -> Iterator[Harness]:
    harness = Harness().up()
    yield harness
    harness.robot.shutdown()


def test_joints_follow_a_reference_and_its_stop(robot: Harness) -> None:
    climb = Climb()
    with robot.robot.stream(timeout_s=0.2) as stream:
        for _ in range(5):
            stream.send_reference(climb, 0.1, moves=True)
            robot.run(0.1)
        assert robot.image.velocity_command == pytest.approx([0.1] * 3, abs=1e-6)
        robot.run(0.5)
        assert robot.image.velocity_command == pytest.approx([0.0] * 3, abs=1e-6)
        assert (climb.begun, climb.stops) == (1, 1)
        assert stream.statistics.timeouts == 1
        stream.send_reference(climb, 0.05, moves=True)
        robot.run(0.15)
        assert robot.image.velocity_command == pytest.approx([0.05] * 3, abs=1e-6)
    assert robot.image.velocity_command == pytest.approx([0.0] * 3, abs=1e-6)
    robot.setpoints.assert_smooth(ACCELERATION)


def test_a_reference_that_does_not_stop_is_left(robot: Harness) -> None:
    climb = Climb()
    climb.deaf = True
    with robot.robot.stream(timeout_s=0.1) as stream:
        stream.send_reference(climb, 0.1, moves=True)
        robot.run(2.0)
        assert robot.image.velocity_command == pytest.approx([0.0] * 3, abs=1e-6)
        assert stream.open
    robot.setpoints.assert_smooth(ACCELERATION)


def test_a_reference_that_raises_ends_the_stream(robot: Harness) -> None:
    climb = Climb()
    stream = robot.robot.stream(timeout_s=10.0)
    stream.send_reference(climb, 0.1, moves=True)
    robot.run(0.2)
    climb.broken = True
    robot.until(lambda: stream._motion.completion.done)
    assert stream._motion.completion.outcome is Outcome.FAULT
    assert stream.message == "its reference failed: RuntimeError: lost"
    assert robot.image.velocity_command == pytest.approx([0.0] * 3, abs=1e-6)
    robot.setpoints.assert_smooth(ACCELERATION)
    stream.close()


def test_a_position_after_a_reference_is_approached(robot: Harness) -> None:
    climb = Climb()
    with robot.robot.stream(timeout_s=10.0) as stream:
        stream.send_reference(climb, 0.1, moves=True)
        robot.run(0.2)
        stream.send([0.2] * 3)
        robot.run(2.0)
        assert robot.image.position_command == pytest.approx([0.2] * 3, abs=1e-6)
    robot.setpoints.assert_smooth(ACCELERATION)


def test_a_reference_begins_when_the_joints_stand(robot: Harness) -> None:
    """Its stop would be longer than theirs: a tool goes straight, and slowly at last."""
    climb = Climb()
    with robot.robot.stream(timeout_s=10.0) as stream:
        stream.send_velocity([2.0, -1.0, 0.5])
        robot.run(0.5)
        stream.send_reference(climb, 0.1, moves=True)
        robot.run(0.1)
        assert climb.begun == 0
        stream.send_reference(climb, 0.2, moves=True)
        robot.run(0.5)
        assert climb.begun == 1
        assert robot.image.velocity_command == pytest.approx([0.2] * 3, abs=1e-6)
    velocity = robot.setpoints.velocity
    assert (np.abs(velocity[:, 0]) < 1e-9).sum() > 1
    robot.setpoints.assert_smooth(ACCELERATION)


def test_a_stop_before_a_reference_begins_forgets_it(robot: Harness) -> None:
    climb = Climb()
    with robot.robot.stream(timeout_s=0.1) as stream:
        stream.send_velocity([2.0] * 3)
        robot.run(0.09)
        stream.send_reference(climb, 0.1, moves=True)
        robot.run(0.02)
        robot.robot.stop("by the test")
        robot.run(0.5)
        assert not stream.open
    assert climb.begun == 0
    assert robot.image.velocity_command == pytest.approx([0.0] * 3, abs=1e-6)


def test_a_reference_needs_all_joints(robot: Harness) -> None:
    with (
        robot.robot.stream(["joint1"]) as stream,
        pytest.raises(InvalidArgument, match="must have all joints"),
    ):
        stream.send_reference(Climb(), 0.1, moves=True)
