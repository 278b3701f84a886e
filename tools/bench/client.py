"""The client of a measurement: round trips one by one, or a load that goes on."""

from __future__ import annotations

import itertools
import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, Self

import numpy as np
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from numpy.typing import NDArray
from std_srvs.srv import Trigger
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import ACTION, WAIT_S, Client
from tools.bench.subjects import Load
from trajectory_msgs.msg import JointTrajectoryPoint
from wmx_ros2_message.srv import EcatGetNetworkState, GetIoBit

JOINTS = [f"joint{number}" for number in range(1, 7)]
SERVICES_HZ = 200
SERVICES = (
    (Trigger, "/wmx/engine/get_status"),
    (GetIoBit, "/wmx/io/get_input_bit"),
    (EcatGetNetworkState, "/wmx/ecat/get_network_state"),
)


class BenchClient(Client):
    """A client of a program on ``domain``; ``with BenchClient(domain) as client``.

    Attributes:
        failures: what went wrong in the threads of the load.
    """

    def __init__(self, domain: int) -> None:
        super().__init__(domain)
        self.failures: list[str] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def round_trips_us(self, service_type: Any, name: str, count: int) -> NDArray[np.float64]:
        """Times of ``count`` calls, one after the other: request to response in a callback."""
        client = self.node.create_client(service_type, name)
        assert client.wait_for_service(WAIT_S), f"no service {name}"
        request = service_type.Request()
        return np.array([timed_us(lambda: client.call_async(request)) for _ in range(count)])

    def acceptance_us(self, count: int) -> NDArray[np.float64]:
        """Times from sending a goal of one point to its acceptance, one goal after the other."""
        client = self._action_client()
        return np.array([self._goal(client, swing(0.05, 0.0, 1)) for _ in range(count)])

    @contextmanager
    def load(self, load: Load) -> Iterator[list[float]]:
        """Load the daemon during the block; yields the round trips in µs as they come."""
        stop = threading.Event()
        times: list[float] = []
        threads = []
        if load is not Load.NONE:
            threads.append(threading.Thread(target=self._swing, args=(stop,)))
        if load is Load.BUSY:
            threads.append(threading.Thread(target=self._call, args=(stop, times)))
        for thread in threads:
            thread.start()
        try:
            yield times
        finally:
            stop.set()
            for thread in threads:
                thread.join()

    def _action_client(self) -> GoalClient:
        client = GoalClient(self.node, FollowJointTrajectory, ACTION)
        assert client.wait_for_server(WAIT_S), f"no action {ACTION}"
        return client

    def _goal(self, client: GoalClient, goal: Any) -> float:
        """Send a goal and wait for its end; the time in µs until it was accepted."""
        handles: list[Any] = []
        answers: list[Any] = []
        send = partial(client.send_goal_async, goal, feedback_callback=lambda _: None)
        accepted_us = timed_us(send, handles)
        timed_us(handles[0].get_result_async, answers)
        result = answers[0].result
        if answers[0].status != GoalStatus.STATUS_SUCCEEDED:
            self.failures.append(f"goal {answers[0].status}: {result.error_string}")
            raise RuntimeError(self.failures[-1])
        return accepted_us

    def _swing(self, stop: threading.Event) -> None:
        client = self._action_client()
        while not stop.is_set():
            self._goal(client, swing(2.0, 0.5))

    def _call(self, stop: threading.Event, times: list[float]) -> None:
        calls = []
        for service_type, name in SERVICES:
            client = self.node.create_client(service_type, name)
            assert client.wait_for_service(WAIT_S), f"no service {name}"
            calls.append((client, service_type.Request()))
        deadline = time.monotonic()
        for client, request in itertools.cycle(calls):
            if stop.is_set():
                return
            start_ns = time.perf_counter_ns()
            client.call_async(request).add_done_callback(
                lambda _, start_ns=start_ns: times.append(since_us(start_ns))
            )
            deadline = max(deadline + 1.0 / SERVICES_HZ, time.monotonic() - 1.0)
            time.sleep(max(0.0, deadline - time.monotonic()))


def swing(duration_s: float, amplitude_rad: float, points: int = 20) -> Any:
    """A goal of all joints, from where they are at rest at zero, out and back."""
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = JOINTS
    for number in range(1, points + 1):
        part = number / points
        position = amplitude_rad * (1.0 - math.cos(2.0 * math.pi * part)) / 2.0
        seconds, nanoseconds = divmod(round(duration_s * part * 1e9), 10**9)
        point = JointTrajectoryPoint(positions=[position] * len(JOINTS))
        point.time_from_start = Duration(sec=seconds, nanosec=nanoseconds)
        goal.trajectory.points.append(point)
    return goal


def timed_us(call: Any, results: list[Any] | None = None) -> float:
    """Measure the time until the future of ``call`` is done; append to ``results``."""
    done = threading.Event()
    times: list[float] = []

    def on_done(future: Any) -> None:
        times.append(since_us(start_ns))
        if results is not None:
            results.append(future.result())
        done.set()

    start_ns = time.perf_counter_ns()
    call().add_done_callback(on_done)
    assert done.wait(WAIT_S), "timeout: no response"
    return times[0]


def since_us(start_ns: int) -> float:
    return (time.perf_counter_ns() - start_ns) / 1000.0
