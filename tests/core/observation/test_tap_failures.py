"""Parts of a tap that raise hold up no others."""

from __future__ import annotations

import pytest
from structlog.testing import capture_logs
from tests.world_backend import Cubes, cube_backend

from robotd.arrays import FloatArray
from robotd.clock.simulated import SteppedClock
from robotd.descriptor import load_robot_descriptor
from robotd.observation.io_sampler import FIELDBUS
from robotd.observation.tap import Tap
from robotd.robot import Robot


def test_a_part_that_raises_holds_up_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []

    def break_(*_: object) -> FloatArray:
        calls.append("broken")
        raise ValueError("the scene is gone")

    monkeypatch.setattr(Cubes, "poses", break_)
    robot = Robot(load_robot_descriptor("cr3a"), cube_backend(), SteppedClock())
    tap = Tap(robot, 1.0)
    tap.add_reader(lambda: break_() and None)
    tap.add_reader(lambda: calls.append("next"))
    robot.start()
    with capture_logs() as lines:
        for _ in range(2):
            tap.observe()
    robot.shutdown()
    assert calls == ["broken", "broken", "next"] * 2
    assert FIELDBUS in [kind for _, kind, _ in tap.samples.since(0)[0]]
    assert [line["event"] for line in lines] == ["the tap failed"] * 2  # once for each
