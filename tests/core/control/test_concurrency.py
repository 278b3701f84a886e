"""Four independent clients on the real clock and the real control-loop thread."""

from __future__ import annotations

import random
import threading
from collections.abc import Iterator

import numpy as np
import pytest
from tests.core.control.harness import ACCELERATION, arm
from tests.core.motion.helpers import peaks_of

from robotd.arrays import FloatArray
from robotd.clock import MonotonicClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.errors import NotReady
from robotd.motion import TrajectoryRejected, TrajectoryRequest
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

GOALS = 6  # of each client
REACH_RAD = 0.2


@pytest.fixture
def robot() -> Iterator[Robot]:
    # A busy computer may stall this process for longer than the device's own watchdog allows.
    patient = {"backends": {"sim": {"stream_timeout_s": 10.0}}, "engine": {"stale_after_s": 10.0}}
    made = Robot(arm(**patient), load_backend("sim"), MonotonicClock())
    made.start()
    yield made
    made.shutdown()


class Client(threading.Thread):
    """Sends goals, cancels some, stops everything now and then."""

    def __init__(self, robot: Robot, seed: int) -> None:
        super().__init__(name=f"client-{seed}")
        self.executions: list[TrajectoryExecution] = []
        self.error: BaseException | None = None
        self._robot = robot
        self._random = random.Random(seed)

    def run(self) -> None:
        try:
            while len(self.executions) < GOALS:
                self._act()
        except BaseException as error:  # noqa: BLE001 - the test looks at it
            self.error = error

    def _act(self) -> None:
        choose = self._random
        if choose.random() < 0.1:
            self._robot.groups.stop()
            return
        targets = [[choose.uniform(-REACH_RAD, REACH_RAD) for _ in range(3)]]
        request = TrajectoryRequest.from_rows(self._robot.joint_names, [0.6], targets)
        start_ns = None
        if choose.random() < 0.3:
            start_ns = self._robot.clock.now_ns() + round(choose.uniform(0, 0.2) * 1e9)
        try:
            with self._robot.follower.follow(request, start_ns=start_ns) as execution:
                self.executions.append(execution)
                execution.wait(choose.uniform(0.0, 0.3))
                if choose.random() < 0.5:
                    execution.cancel()
                execution.wait(choose.uniform(0.0, 0.3))
        except (TrajectoryRejected, NotReady):
            pass  # no time to stop before a target so near, or an axis not idle yet


def test_every_goal_of_every_client_ends_with_an_outcome(robot: Robot) -> None:
    steps: list[FloatArray] = []
    stream, last = robot.control_loop._driver.stream, [robot.image.position_command.copy()]

    def record(position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        steps.append(np.abs(position - last[0]))
        last[0] = position.copy()
        stream(position, velocity, due_ns)

    robot.control_loop._mixer._driver.stream = record  # type: ignore[method-assign]
    clients = [Client(robot, number) for number in range(4)]
    for client in clients:
        client.start()
    for client in clients:
        client.join(30.0)
        assert not client.is_alive()
        assert client.error is None, client.error
    executions = [execution for client in clients for execution in client.executions]
    for execution in executions:
        assert execution.done
        assert execution.outcome is not None
        assert execution.message
    outcomes = {execution.outcome for execution in executions}
    assert {Outcome.CANCELED, Outcome.PREEMPTED} <= outcomes
    assert robot.groups.only.motion._active == 0
    # A loop that missed deadlines makes one step of several: that of the longest pause.
    missed = 1 + robot.control_loop.stats.missed
    assert np.max(steps) < 3.0 * 1.1 * robot.control_loop.period_ns * 1e-9 * missed
    _assert_works(robot)


def _assert_works(robot: Robot) -> None:
    request = TrajectoryRequest.from_rows(robot.joint_names, [1.0], [[0.0, 0.0, 0.0]])
    with robot.follower.follow(request) as execution:
        assert execution.wait(10.0)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert float(peaks_of(execution.trajectory).acceleration.value.max()) < ACCELERATION
