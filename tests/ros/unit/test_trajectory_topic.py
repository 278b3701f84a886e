"""Trajectories of a topic that wait for a worker."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from itertools import count
from types import SimpleNamespace
from typing import Any

import pytest
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robotd_ros.nodes import trajectory_topic
from robotd_ros.nodes.trajectory_topic import TIMEOUT_S, TrajectoryTopic


class Harness:
    """Topic over stand-ins: calls of workers wait, and motions end at once."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 100.0
        self.waiting: list[Callable[[], None]] = []
        self.begun: list[Any] = []
        self.rejections: list[str] = []
        tickets = count(1)
        monkeypatch.setattr(trajectory_topic, "add_command_subscription", lambda *_, **__: None)
        monkeypatch.setattr("time.monotonic", lambda: self.now_s)
        admission = SimpleNamespace(holds=True)
        source = SimpleNamespace(admit=lambda *, moves: admission)
        group: Any = SimpleNamespace(
            follower=SimpleNamespace(source=lambda *_: source, follow=self._follow),
            motion=SimpleNamespace(ticket=lambda: next(tickets)),
        )
        host: Any = SimpleNamespace(
            submit=lambda function, *args, **_: self.waiting.append(partial(function, *args)),
            on_rejection=lambda topic, axes, reason: self.rejections.append(reason),
        )
        robot: Any = SimpleNamespace(clock=None, rearming=None)
        node: Any = SimpleNamespace(get_clock=lambda: None)
        stream: Any = SimpleNamespace(stop=lambda: None)
        self.topic = TrajectoryTopic(node, robot, group, host, "trajectory", stream, 0.1)

    def send(self, seconds: int) -> None:
        """Take a trajectory that lasts ``seconds``; 0: one without points."""
        point = JointTrajectoryPoint(positions=[0.1])
        point.time_from_start.sec = seconds
        points = [point] if seconds else []
        self.topic._take(JointTrajectory(joint_names=["joint1"], points=points), 0)

    def _follow(self, *args: Any) -> AbstractContextManager[Any]:
        self.begun.append(args)
        execution = SimpleNamespace(wait=lambda: None, cancel=lambda: None, message="reached")
        return nullcontext(execution)


@pytest.mark.parametrize(("waited_s", "executed"), [(0.1, True), (TIMEOUT_S + 0.1, False)])
def test_a_trajectory_that_has_waited_long_for_a_worker_moves_nothing(
    monkeypatch: pytest.MonkeyPatch, waited_s: float, executed: bool
) -> None:
    harness = Harness(monkeypatch)
    harness.send(2)
    harness.now_s += waited_s
    harness.waiting[0]()
    assert bool(harness.begun) is executed
    assert bool(harness.rejections) is not executed


def test_a_trajectory_that_was_stopped_while_it_waited_for_a_worker_moves_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    harness = Harness(monkeypatch)
    harness.send(2)
    harness.send(0)
    harness.send(3)
    for call in harness.waiting:
        call()
    assert len(harness.begun) == 1
    assert harness.rejections == ["the trajectory was stopped before it could begin"]
