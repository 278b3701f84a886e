"""A robotd process on the simulation, and a client of it in the test's process."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, ClassVar, Self

import rclpy
from control_msgs.action import FollowJointTrajectory
from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from robotd_msgs.msg import AxisOwners
from robotd_msgs.srv import InjectFault
from std_msgs.msg import Bool
from tests.ros.action_client import GoalClient

from robotd_ros.host import RosHost
from robotd_ros.operator_messages import OWNERS, read_owners
from robotd_testing.domain import own_domain

BACKEND = os.environ.get("ROBOTD_TEST_BACKEND", "sim")  # the surface is the same on all
ENGINES = itertools.count()
WAIT_S = 60.0  # far longer than on an idle computer
ACTION = "/movensys_manipulator_arm_controller/follow_joint_trajectory"
# Time-outs that outlast a stall of the whole computer, for tests that are not about them.
PATIENCE: dict[str, dict[str, object]] = {
    "sim": {"backends.sim.stream_timeout_s": 10},
    "wmx": {"backends.wmx.watchdog_s": 10},
    "ethercat": {
        "backends.ethercat.simulated": "true",
        "backends.ethercat.stream_timeout_s": 10,
        "backends.ethercat.max_lost_frames": 100,
        "backends.ethercat.watchdog_ms": 5000,
        "cycle.rate_hz": 250,
    },
}
FOR_ALL: dict[str, object] = {
    "engine.stale_after_s": 5,
    "trajectory.path_tolerance_rad": 3,  # a joint that a stall has led off its path goes back
}
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def wait_until(condition: Callable[[], Any], what: str, timeout_s: float = WAIT_S) -> Any:
    """The first true answer of ``condition``; fails, naming ``what``, when there is none."""
    deadline = time.monotonic() + timeout_s
    while not (answer := condition()):
        assert time.monotonic() < deadline, f"timeout: {what}"
        time.sleep(0.005)
    return answer


def command_until(
    publish: Callable[[], Any], condition: Callable[[], Any], what: str, rate_hz: float = 50.0
) -> None:
    """Publish commands until ``condition`` holds.

    They pause now and then: a robot that a stall of the computer has stopped takes commands again
    from a client that was silent.
    """
    begin_s = time.monotonic()

    def attempt() -> Any:
        if (time.monotonic() - begin_s) % 6.0 < 5.0:
            publish()
        time.sleep(1.0 / rate_hz)
        return condition()

    wait_until(attempt, what)


def wait_for(future: Any, timeout_s: float = WAIT_S) -> Any:
    """The result of an rclpy future that another thread completes."""
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    assert done.wait(timeout_s), "timeout: no response"
    return future.result()


def stamp_s(message: Any) -> float:
    """The time in a message's header."""
    return float(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9)


def patience(backend: str) -> list[str]:
    """The arguments that set the time-outs of ``FOR_ALL`` and ``PATIENCE``."""
    values = FOR_ALL | PATIENCE.get(backend, {})
    return [word for key, value in values.items() for word in ("--set", f"{key}={value}")]


class RobotProcess:
    """``robotd run`` with its standard output and error in one text.

    Its time-outs are patient, see ``PATIENCE``, unless ``patient`` is False. In ``simulated_time``,
    which only the simulation can be in, it cannot be late: its time waits for the computer.
    A ``connected`` client has this time, which may be a message old. With ``terminal``, the
    slave of a pseudo-terminal, it is the leader of a session there, and its output goes there.
    ``prefix`` are words before its command. A test that fails reports the output of those that
    are ``running``.
    """

    running: ClassVar[list[RobotProcess]] = []

    def __init__(
        self,
        *arguments: str,
        domain: int | None = None,
        robot: str = "cr3a",
        backend: str = BACKEND,
        python: str | Path = sys.executable,
        patient: bool = True,
        simulated_time: bool = False,
        terminal: int | None = None,
        prefix: Sequence[str] = (),
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self._exit = ExitStack()
        self.domain = self._exit.enter_context(own_domain()) if domain is None else domain
        self._log = self._exit.enter_context(tempfile.TemporaryFile("w+"))  # noqa: SIM115
        variables = os.environ | {
            "ROS_DOMAIN_ID": str(self.domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "XDG_STATE_HOME": self._exit.enter_context(tempfile.TemporaryDirectory()),
            "WMX_STANDIN_SHM": f"robotd-test-{os.getpid()}-{next(ENGINES)}",  # of its own
            **(environment or {}),
        }
        self.simulated_time = simulated_time and backend == "sim"
        if self.simulated_time:
            arguments = ("--time-scale", "1", *arguments)
        if patient:
            arguments = (*patience(backend), *arguments)
        session = [] if terminal is None else ["setsid", "--ctty"]
        command = [python, "-m", "robotd", "--robot", robot, "--backend", backend, *arguments]
        self.process = subprocess.Popen(
            [*prefix, *session, *command],
            stdin=terminal,
            stdout=self._log if terminal is None else terminal,
            stderr=subprocess.STDOUT,
            env=variables,
        )
        self.running.append(self)
        self._exit.callback(self.running.remove, self)

    @property
    def output(self) -> str:
        """All that was printed so far."""
        return Path(f"/proc/self/fd/{self._log.fileno()}").read_text()

    def wait_ready(self) -> None:
        self.wait_output("ready after")

    def wait_output(self, text: str) -> None:
        def found() -> bool:
            if text in self.output:
                return True
            assert self.process.poll() is None, f"ended early:\n{self.output}"
            return False

        wait_until(found, f"{text!r} in the output")

    def end(self, number: int = signal.SIGINT) -> int:
        """Send a signal; the exit status."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.exit_status()

    def exit_status(self) -> int:
        try:
            return self.process.wait(WAIT_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise AssertionError(f"does not end:\n{self.output}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with self._exit:
            self.end()


class Client:
    """Calls services, keeps messages and sends goals; callbacks run in a thread of its own."""

    def __init__(self, domain: int, *, simulated_time: bool = False) -> None:
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        self.domain = domain
        self.host = RosHost(domain_id=domain)
        self.host.start()
        time = Parameter("use_sim_time", value=simulated_time)
        self.node = rclpy.create_node(
            "client", context=self.host.context, parameter_overrides=[time]
        )
        self.host.add_node(self.node)
        self._clients: dict[str, Any] = {}
        self._actions: dict[str, GoalClient] = {}

    def close(self) -> None:
        self.host.close()

    @property
    def now_ns(self) -> int:
        """Time by the clock of the robot; that of a simulation may be a message old."""
        return int(self.node.get_clock().now().nanoseconds)

    def actions_of(self, node: str) -> dict[str, str]:
        """Name → type of the actions that ``node`` serves; none while it is not yet found.

        The names of nodes come by a topic of their own, later than topics and services, and rclpy
        fails for a node that it does not know.
        """
        if node not in self.node.get_node_names():
            return {}
        return names_of(get_action_server_names_and_types_by_node(self.node, node, "/"))

    def call(self, service_type: Any, name: str, /, **request: Any) -> Any:
        """The response of a service; the request's fields by name."""
        client = self._clients.get(name)
        if client is None:
            client = self._clients[name] = self.node.create_client(service_type, name)
            assert client.wait_for_service(WAIT_S), f"no service {name}"
        return wait_for(client.call_async(service_type.Request(**request)))

    def inject(self, kind: str, **settings: Any) -> Any:
        """The response to a fault of the simulation."""
        messages = [Parameter(name, value=it).to_parameter_msg() for name, it in settings.items()]
        return self.call(InjectFault, "/robotd_sim/inject", kind=kind, settings=messages)

    def listen(self, message_type: Any, topic: str, qos: Any = 10) -> list[Any]:
        """A list that every message of ``topic`` is appended to from now on."""
        messages: list[Any] = []
        self.node.create_subscription(message_type, topic, messages.append, qos)
        return messages

    def listen_owners(self) -> list[dict[str, str]]:
        """A list that the owners by axis are appended to at every change."""
        owners: list[dict[str, str]] = []
        self.node.create_subscription(
            AxisOwners, f"/{OWNERS}", lambda message: owners.append(read_owners(message)), LATCHED
        )
        return owners

    def next(self, messages: list[Any], condition: Callable[[Any], Any] = lambda _: True) -> Any:
        """The first message after this call that fulfils ``condition``."""
        start = len(messages)

        def find() -> Any:
            return next((m for m in messages[start:] if condition(m)), None)

        return wait_until(find, "no message that fulfils the condition")

    def publisher(self, message_type: Any, topic: str) -> Any:
        """A publisher that the server's subscription has found."""
        publisher = self.node.create_publisher(message_type, topic, 10)
        wait_until(publisher.get_subscription_count, f"no subscription of {topic}")
        return publisher

    def wait_engine(self, ready: bool = True, topic: str = "/wmx/engine/ready") -> None:
        messages = self.listen(Bool, topic, LATCHED)
        wait_until(lambda: messages and messages[-1].data is ready, f"{topic} is {ready}")

    def send_goal(
        self,
        goal: Any,
        feedback: list[Any] | None = None,
        *,
        action: str = ACTION,
        ask_result: bool = True,
    ) -> Goal:
        """Send a goal and wait until it is accepted; without ``ask_result`` ask for it later."""
        client = self._actions.get(action)
        if client is None:
            client = GoalClient(self.node, FollowJointTrajectory, action)
            self._actions[action] = client
            assert client.wait_for_server(WAIT_S)
        on_feedback = (
            None if feedback is None else lambda message: feedback.append(message.feedback)
        )
        handle = wait_for(client.send_goal_async(goal, feedback_callback=on_feedback))
        assert handle.accepted
        return Goal(handle, ask_result=ask_result)


class Goal:
    """An accepted goal; its result is asked for from the start, or by ``ask_result``."""

    def __init__(self, handle: Any, *, ask_result: bool = True) -> None:
        self._handle = handle
        if ask_result:
            self.ask_result()

    def ask_result(self) -> None:
        """Send the request for the result."""
        self._result = self._handle.get_result_async()

    @property
    def done(self) -> bool:
        return bool(self._result.done())

    def result(self) -> tuple[int, Any]:
        """Status and result message, when it has ended."""
        answer = wait_for(self._result)
        return answer.status, answer.result

    def cancel(self) -> Any:
        """The response to a cancel request."""
        return wait_for(self._handle.cancel_goal_async())


def names_of(listing: Sequence[tuple[str, list[str]]]) -> dict[str, str]:
    """Name → first type, of a listing of the graph."""
    return {name: types[0] for name, types in listing}


@contextmanager
def connected(process: RobotProcess) -> Iterator[Client]:
    """A client of ``process`` that has found its engine; closed after the block."""
    client = Client(process.domain, simulated_time=process.simulated_time)
    try:
        client.wait_engine()
        yield client
    finally:
        client.close()
