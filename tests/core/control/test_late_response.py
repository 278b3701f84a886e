"""Drives that follow a tenth of a second later: the lag is neither a following error nor rest."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import pytest
from tests.core.control.harness import arm
from tests.core.control.test_slow_feedback import until_done
from tests.features.conformance.runs.whole_arm import ArmAxes, WholeArm

from robotd.arrays import FloatArray
from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.plugin.manager import Backend, PluginOrigin
from robotd.robot import Robot

RESPONSE_S = 0.1
PERIODS = 50  # of 2 ms


@pytest.fixture(params=[RESPONSE_S, 0.0], ids=["declared", "not declared"])
def robot(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Robot]:
    send, waiting = ArmAxes.send_targets, deque[FloatArray]()

    def send_later(self: ArmAxes, positions: FloatArray) -> None:
        waiting.append(positions.copy())
        if len(waiting) > PERIODS:
            send(self, waiting.popleft())

    monkeypatch.setattr(ArmAxes, "send_targets", send_later)
    monkeypatch.setattr(ArmAxes, "response_s", request.param)
    origin = PluginOrigin("whole", "tests.features.conformance.runs.whole_arm", "whole", "1.0")
    robot = Robot(arm(), Backend(origin, WholeArm()), SteppedClock())
    robot.start()
    robot.step(2 * PERIODS)
    yield robot
    robot.shutdown()


def test_a_late_response_is_no_following_error_where_it_is_declared(robot: Robot) -> None:
    outcome, message, _ = until_done(robot)
    if robot.axes.response_s:
        assert outcome is Outcome.SUCCEEDED, message
        assert robot.image.position[0] == pytest.approx(1.5, abs=0.01)
    else:
        assert outcome is Outcome.PATH_TOLERANCE, message
