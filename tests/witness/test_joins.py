"""Segments that are appended to a motion of the tool: judged at the drives, where they join."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
from tests.witness.backends import BENCHES
from tests.witness.bench import Bench

from robotd.api.robots import Outcome
from robotd.control.sources.streamed_trajectory import StreamedTrajectory
from robotd.motion.trajectory import Sampler
from robotd_tool_space import Line
from robotd_tool_space.sequences import sequence_run
from robotd_tool_space.tool_groups import ToolGroups

take = StreamedTrajectory._take


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = BENCHES["dobot-tool"](rate_hz=100.0)
    with made.requested():
        made.robot.start()
    yield made
    made.robot.shutdown()
    made.close()


def follow(bench: Bench, part: float = 0.3) -> list[bool]:
    """Append a line to a motion of which a part is over; return whether it has joined."""
    tool = bench.robot.feature(ToolGroups).only
    tool.execute(tool.plan_joints(np.array(bench.bent)))
    corner, end = tool.pose_relative(y=0.15), tool.pose_relative(y=0.15, z=-0.1)
    run = tool.sequence(tool.plan_parts([Line(corner, blend_m=0.02)]), tool.arrive())
    joined: list[bool] = []

    def tick() -> None:
        if not joined and run.progress().part > part:
            joined.append(run.append([Line(end)]))

    outcome, message = run.run(tick)
    assert outcome is Outcome.SUCCEEDED, message
    return joined


@pytest.mark.parametrize("part", [0.1, 0.3, 0.6, 0.9])
def test_a_join_is_no_step(bench: Bench, part: float) -> None:
    assert follow(bench, part) == [part < 0.5]  # else it comes to rest first
    assert bench.findings == []


class WrongSampler(Sampler):
    """Reads a trajectory of other positions, at another time."""

    def __init__(self, trajectory: Any, ahead_s: float, offset_rad: float) -> None:
        super().__init__(trajectory)
        self._ahead_s, self._offset_rad = ahead_s, offset_rad

    def sample(self, time_s: float, out: Any) -> None:
        super().sample(time_s + self._ahead_s, out)
        out[0] += self._offset_rad


@pytest.mark.parametrize(
    ("ahead_s", "offset_rad", "what"),
    [
        (0.0, 0.05, "target steps by"),
        (0.05, 0.0, "velocity of the target changes"),
        (-0.05, 0.0, "velocity of the target changes"),
        (0.0, 0.005, "velocity of the target changes"),
    ],
)
def test_a_step_at_the_join(
    ahead_s: float, offset_rad: float, what: str, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    sampler = partial(WrongSampler, ahead_s=ahead_s, offset_rad=offset_rad)

    def take_wrongly(motion: Any, extension: Any) -> None:
        take(motion, extension)
        motion._sampler = sampler(extension.trajectory)

    monkeypatch.setattr(StreamedTrajectory, "_take", take_wrongly)
    assert follow(bench) == [True]
    assert any(what in finding for finding in bench.findings), bench.findings


@pytest.mark.parametrize("accepts_late", [False, True])
def test_a_join_that_comes_too_late(
    accepts_late: bool, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A trajectory time at which both were the same has passed."""
    monkeypatch.setattr(sequence_run, "LEADS_S", (-0.4,))
    if accepts_late:
        monkeypatch.setattr(StreamedTrajectory, "_take", take_late)
    assert follow(bench, 0.85) == [accepts_late]
    assert bool(bench.findings) == accepts_late, bench.findings


def take_late(motion: Any, extension: Any) -> None:
    extension.same_s = motion.time_s
    take(motion, extension)
