"""Trajectories of a topic that wait for a worker."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robotd_ros.nodes import trajectory_topic
from robotd_ros.nodes.trajectory_topic import TIMEOUT_S, TrajectoryTopic


@pytest.mark.parametrize(("waited_s", "executed"), [(0.1, True), (TIMEOUT_S + 0.1, False)])
def test_a_trajectory_that_has_waited_long_for_a_worker_moves_nothing(
    monkeypatch: pytest.MonkeyPatch, waited_s: float, executed: bool
) -> None:
    now_s = [100.0]
    waiting: list[Callable[[], None]] = []
    begun: list[Any] = []
    rejections: list[str] = []

    def follow(*args: Any) -> AbstractContextManager[Any]:
        begun.append(args)
        return nullcontext(SimpleNamespace(wait=lambda: None, message="reached"))

    monkeypatch.setattr(trajectory_topic, "add_command_subscription", lambda *_, **__: None)
    monkeypatch.setattr("time.monotonic", lambda: now_s[0])
    admission = SimpleNamespace(holds=True)
    source = SimpleNamespace(admit=lambda *, moves: admission)
    group: Any = SimpleNamespace(
        follower=SimpleNamespace(source=lambda *_: source, follow=follow),
        motion=SimpleNamespace(ticket=lambda: 1),
    )
    host: Any = SimpleNamespace(
        submit=lambda function, *args, **_: waiting.append(partial(function, *args)),
        on_rejection=lambda topic, axes, reason: rejections.append(reason),
    )
    robot: Any = SimpleNamespace(clock=None, rearming=None)
    node: Any = SimpleNamespace(get_clock=lambda: None)
    stream: Any = None
    topic = TrajectoryTopic(node, robot, group, host, "trajectory", stream, 0.1)
    point = JointTrajectoryPoint(positions=[0.1])
    point.time_from_start.sec = 2
    topic._take(JointTrajectory(joint_names=["joint1"], points=[point]), 0)
    now_s[0] += waited_s
    waiting[0]()
    assert bool(begun) is executed
    assert bool(rejections) is not executed
