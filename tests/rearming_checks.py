"""Check of a robot in real time whose client commands on through a fault and its recovery."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from robotd.clock import MonotonicClock, wait_until
from robotd.control.groups.problem import ProblemKind
from robotd.robot import Robot
from robotd_ros.nodes.topic_stream import TopicStream

RATE_HZ = 50.0
SPEED = 0.2  # rad/s, of the target
PATIENCE_S = 15.0


class Commander:
    """Sends targets of the first joint that move at ``SPEED`` while it is on, as a topic does."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.on, self.target = robot, False, 0.0
        self._workers, self._closing = ThreadPoolExecutor(2), threading.Event()
        self._thread = threading.Thread(target=self._run)

    @property
    def position(self) -> float:
        return float(self.robot.image.position[self.robot.joint_axes[0]])

    @property
    def problems(self) -> list[str]:
        found = self.robot.find_problems()
        return [problem.text for problem in found if problem.kind is ProblemKind.SOURCE]

    def begin(self) -> None:
        """Command from the present position on."""
        self.target, self.on = self.position, True

    def submit(self, function: Callable[..., Any], *args: Any, until_rest: bool) -> None:
        self._workers.submit(function, *args)

    def on_rejection(self, topic: str, axes: Sequence[int], reason: str) -> None:
        """Take the place of a host, to which nobody listens."""

    @contextmanager
    def running(self) -> Iterator[None]:
        self._thread.start()
        try:
            yield
        finally:
            self._closing.set()
            self._thread.join()
            self._workers.shutdown()

    def _run(self) -> None:
        host: Any = self
        topic = TopicStream(self.robot.stream.client("targets", 0.2), host, "targets")
        others = [float(place) for place in self.robot.image.position[list(self.robot.joint_axes)]]
        while not self._closing.wait(1.0 / RATE_HZ):
            if self.on:
                self.target += SPEED / RATE_HZ
                target = [self.target, *others[1:]]
                topic.apply(lambda commands, target=target: commands.position(target))


def until(condition: Callable[[], object]) -> None:
    assert wait_until(lambda: bool(condition()), PATIENCE_S, MonotonicClock())


def check_recovery(robot: Robot, trip: Callable[[], object], heal: Callable[[], object]) -> None:
    """Assert that nothing moves after ``robotd recover`` until the client was silent."""
    commander = Commander(robot)
    with commander.running():
        start = commander.position
        commander.begin()
        until(lambda: abs(commander.position - start) > 0.05)
        trip()
        until(lambda: robot.problems)
        axes = list(robot.joint_axes)
        image = robot.image  # of an offline drive it has the last velocity
        until(lambda: not (abs(image.velocity[axes]) * ~image.offline[axes] > 1e-2).any())
        until(lambda: not abs(commander.target - commander.position) < 0.2)
        heal()
        robot.recover()
        start = commander.position
        until(lambda: commander.problems)
        target = commander.target
        until(lambda: commander.target > target + 0.1)
        assert abs(commander.position - start) < 2e-3
        assert "targets kept commanding while motion was rejected" in commander.problems[0]
        commander.on = False
        until(lambda: not commander.problems)
        start = commander.position
        commander.begin()
        until(lambda: commander.position - start > 0.05)
        assert commander.position - start < 0.3
