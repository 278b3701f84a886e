"""Paths wait for a drive that does not answer, and what remains fades within the limits.

``Silence`` stands in for a bus on the simulation: while it lasts, its axes get no setpoint and the
image says so. It does not model frames that are under way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from tests.core.control.harness import ACCELERATION, PERIOD_S, Harness, arm

from robotd.arrays import FloatArray
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.process_image import ProcessImage

CATCH_UP = 0.1 * 3.0  # rad/s: share of the velocity limit


class Silence:
    """Axes whose drives do not answer, between ``begin`` and ``end``."""

    def __init__(self, harness: Harness) -> None:
        self.axes: list[int] = []
        self._harness, driver = harness, harness.mixer._driver
        self._read, self._stream = driver.read, driver.stream
        self._held: FloatArray = np.zeros(0)
        driver.read, driver.stream = self.read, self.stream  # type: ignore[method-assign]
        harness.robot.control_loop._driver.read = self.read  # type: ignore[method-assign]

    def begin(self, *axes: int) -> None:
        self._held = self._harness.setpoints.position[-1][list(axes)]
        self.axes = list(axes)

    def end(self) -> None:
        self.axes = []

    def read(self, image: ProcessImage) -> None:
        self._read(image)
        image.silent[:] = False
        if self.axes:
            image.silent[self.axes] = True
            image.position_command[self.axes], image.velocity_command[self.axes] = self._held, 0.0

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        if self.axes:
            position, velocity = position.copy(), velocity.copy()
            position[self.axes], velocity[self.axes] = self._held, 0.0
        self._stream(position, velocity, due_ns)


@pytest.fixture
def harness() -> Iterator[Harness]:
    harness = Harness(arm(stream={"takeover": True})).up()
    yield harness
    harness.robot.shutdown()


def assert_within_limits(harness: Harness, silence_begins: int, *silent: int) -> None:
    """Judge each setpoint by the one before; the stop of a silent axis is the drive's own."""
    steps = np.diff(harness.setpoints.position, axis=0) / PERIOD_S
    assert np.abs(steps).max() <= 3.0 * 1.2
    changes = np.diff(steps, axis=0) / PERIOD_S
    changes[silence_begins - 2 : silence_begins + 1, list(silent)] = 0.0
    assert np.abs(changes).max() <= ACCELERATION * 1.5


@pytest.mark.parametrize("silence_s", [0.002, 0.01, 0.05, 0.1, 1.0])
@pytest.mark.parametrize("joints", [(0,), (0, 2), (0, 1, 2)])
def test_a_goal_waits_for_silent_drives(
    harness: Harness, joints: tuple[int, ...], silence_s: float
) -> None:
    silence = Silence(harness)
    with harness.goal((1.0, -0.6, 0.3), seconds=1.5) as execution:
        harness.run(0.7)
        begins = len(harness.setpoints.rows)
        silence.begin(*joints)
        harness.run(silence_s)
        silence.end()
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert_within_limits(harness, begins, *joints)
    assert harness.setpoints.position[-1] == pytest.approx([1.0, -0.6, 0.3], abs=1e-4)


def test_a_joint_that_was_left_too_far_behind_ends_the_goal_and_says_why(
    harness: Harness,
) -> None:
    silence = Silence(harness)
    with harness.goal((2.5, 0.0, 0.0), seconds=1.8) as execution:
        harness.run(0.9)
        begins = len(harness.setpoints.rows)
        silence.begin(0)
        harness.run(0.3)
        silence.end()
        harness.end(execution)
    assert execution.outcome is Outcome.FAULT
    assert "joint1 is 0.1" in execution.message
    assert "off its path after its drive did not answer for" in execution.message
    assert_within_limits(harness, begins, 0)


def test_a_goal_does_not_end_before_a_silent_drive_has_answered(harness: Harness) -> None:
    silence = Silence(harness)
    with harness.goal((0.5, 0.0, 0.0), seconds=1.0) as execution:
        harness.run(0.98)
        silence.begin(0)
        harness.run(2.0)
        assert not execution.done
        silence.end()
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED
    assert harness.image.position[0] == pytest.approx(0.5, abs=1e-3)


def test_a_stop_during_a_silence_ends_at_rest(harness: Harness) -> None:
    silence = Silence(harness)
    with harness.goal((1.0, -0.6, 0.3), seconds=1.5) as execution:
        harness.run(0.7)
        begins = len(harness.setpoints.rows)
        silence.begin(0)
        harness.run(0.02)
        execution.completion.request(Outcome.STOPPED, "asked for")
        harness.run(0.1)
        silence.end()
        harness.end(execution)
    assert execution.outcome is Outcome.STOPPED
    assert_within_limits(harness, begins, 0)
    assert np.abs(harness.image.velocity).max() < 0.01


@pytest.mark.parametrize("silent", [(0,), (0, 1, 2)])
@pytest.mark.parametrize("mode", ["target", "smooth"])
def test_a_stream_slows_to_rest_and_goes_on_with_the_next_command(
    harness: Harness, mode: str, silent: tuple[int, ...]
) -> None:
    silence = Silence(harness)
    with harness.robot.stream(mode=mode) as stream:
        for index in range(120):
            stream.send([0.4 * math.sin(2.0 * index / 30.0)] * 3)
            if index == 40:
                begins = len(harness.setpoints.rows)
                silence.begin(*silent)
            if index == 50:
                assert np.abs(harness.setpoints.velocity[-1]).max() < 1e-6, "all wait"
                silence.end()
            harness.run(1.0 / 30.0)
        assert harness.image.position[0] == pytest.approx(harness.image.position[1], abs=0.05)
        assert not stream.message
    assert_within_limits(harness, begins, *silent)


def test_a_goal_that_takes_over_from_a_stream_begins_where_a_silent_joint_is(
    harness: Harness,
) -> None:
    silence = Silence(harness)
    stream = harness.robot.stream()
    for index in range(30):
        stream.send([0.6 * math.sin(2.0 * index / 30.0)] * 3)
        harness.run(1.0 / 30.0)
    begins = len(harness.setpoints.rows)
    silence.begin(0)
    harness.run(0.05)
    silence.end()
    with harness.goal((0.2, 0.2, 0.2), seconds=2.0) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED
    assert_within_limits(harness, begins, 0)
    stream.close()


def repeated(length: int) -> list[Any]:
    return [pytest.param(seed, id=f"seed {seed}") for seed in range(length)]


@pytest.mark.parametrize("seed", repeated(12))
def test_repeated_silences_keep_every_setpoint_within_the_limits(
    harness: Harness, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    silence, begun = Silence(harness), list[tuple[int, list[int]]]()
    with harness.goal(
        (0.8, -0.6, 0.45), (-0.4, 0.4, 0.2), (0.0, 0.0, 0.0), seconds=1.5
    ) as execution:
        while not execution.done:
            harness.run(float(rng.uniform(0.004, 0.5)))
            joints = [joint for joint in range(3) if rng.random() < 0.5]
            if joints and not execution.done:
                begun.append((len(harness.setpoints.rows), joints))
                silence.begin(*joints)
                harness.run(float(rng.choice([0.002, 0.006, 0.02, 0.06])))
                silence.end()
    steps = np.diff(harness.setpoints.position, axis=0) / PERIOD_S
    assert np.abs(steps).max() <= 3.0 * 1.2
    changes = np.diff(steps, axis=0) / PERIOD_S
    for begins, joints in begun:
        changes[begins - 2 : begins + 1, joints] = 0.0
    assert np.abs(changes).max() <= ACCELERATION * 1.5
    assert execution.outcome in (Outcome.SUCCEEDED, Outcome.FAULT)
