"""The host on real rclpy: nothing blocks the others, nothing dies, nothing is left behind."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest
import rclpy
from action_msgs.srv import CancelGoal
from control_msgs.action import FollowJointTrajectory
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from std_msgs.msg import Empty, Float64
from std_srvs.srv import SetBool, Trigger
from structlog.testing import capture_logs
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import wait_until
from wmx_ros2_message.srv import SetAxis

from robotd.call_timeout import end_idle_threads
from robotd.control.loop.setpoint_source import Outcome
from robotd.errors import NotReady, OperationError
from robotd.log import get_logger
from robotd_ros.host import RosHost
from robotd_ros.services import add_service, add_subscription
from robotd_ros.worker_action import WorkerAction

pytestmark = [pytest.mark.daily, pytest.mark.ros]

EXECUTORS = [EventsExecutor, SingleThreadedExecutor]
WAIT_S = 60.0


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only this process, unless a test says otherwise."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(os.getpid() % 100))


@pytest.fixture(params=EXECUTORS)
def host(request: pytest.FixtureRequest) -> Iterator[RosHost]:
    with RosHost(make_executor=request.param, workers=2, close_timeout_s=0.2) as host:
        yield host


@pytest.fixture
def server(host: RosHost) -> Node:
    node = rclpy.create_node("server", context=host.context)
    host.add_node(node)
    return node


class Caller:
    """A client in its own context and thread."""

    def __init__(self, host: RosHost) -> None:
        self._node = rclpy.create_node("caller", context=host.context)
        host.add_node(self._node)
        self.node = self._node

    def send(self, service_type: Any, name: str, request: Any = None) -> Callable[[], Any]:
        """Send a request; the result waits for the response."""
        client = self._node.create_client(service_type, name)
        assert client.wait_for_service(WAIT_S)
        future = client.call_async(request or service_type.Request())
        return lambda: wait_for(future)

    def call(self, service_type: Any, name: str, request: Any = None) -> Any:
        return self.send(service_type, name, request)()


@pytest.fixture
def caller() -> Iterator[Caller]:
    with RosHost() as host:
        yield Caller(host)


def wait_for(future: Any) -> Any:
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    assert done.wait(WAIT_S), "no answer"
    return future.result()


def thread_count() -> int:
    return len(list(Path("/proc/self/task").iterdir()))


def echo_thread(_: Any, response: Any) -> Any:
    response.success = True
    response.message = threading.current_thread().name
    return response


def test_handlers_run_where_they_should(host: RosHost, server: Node, caller: Caller) -> None:
    add_service(server, host, Trigger, "worker", echo_thread)
    add_service(server, host, Trigger, "inline", echo_thread, blocking=False)
    add_service(server, host, Trigger, "urgent", echo_thread, urgent=True)
    assert caller.call(Trigger, "worker").message.startswith("robotd-worker_")
    assert caller.call(Trigger, "inline").message == "robotd-ros"
    assert caller.call(Trigger, "urgent").message.startswith("robotd-urgent_")


def test_blocking_handlers_hold_up_neither_others_nor_urgent_ones(
    host: RosHost, server: Node, caller: Caller
) -> None:
    release = threading.Event()

    def block(_: Any, response: Any) -> Any:
        release.wait(WAIT_S)
        response.success = True
        return response

    add_service(server, host, Trigger, "block", block)
    add_service(server, host, Trigger, "inline", echo_thread, blocking=False)
    add_service(server, host, Trigger, "urgent", echo_thread, urgent=True)
    blocked = [caller.send(Trigger, "block") for _ in range(3)]  # more than there are workers
    assert caller.call(Trigger, "inline").success
    assert caller.call(Trigger, "urgent").success
    release.set()
    assert all(answer().success for answer in blocked)


def test_an_arrival_is_noted_while_all_workers_are_busy(
    host: RosHost, server: Node, caller: Caller
) -> None:
    release, arrived = threading.Event(), []
    all_arrived = threading.Event()

    def note(_: Any) -> int:
        arrived.append(threading.current_thread().name)
        if len(arrived) == 3:  # more than there are workers
            all_arrived.set()
        return len(arrived)

    def block(number: int, response: Any) -> str:
        release.wait(WAIT_S)
        return f"request {number}"

    add_service(server, host, Trigger, "noted", block, on_arrival=note)
    answers = [caller.send(Trigger, "noted") for _ in range(3)]
    assert all_arrived.wait(WAIT_S)
    release.set()
    assert {answer().message for answer in answers} == {"request 1", "request 2", "request 3"}
    assert set(arrived) == {"robotd-ros"}


@pytest.mark.parametrize("blocking", [True, False])
def test_every_handler_is_answered(
    host: RosHost, server: Node, caller: Caller, blocking: bool
) -> None:
    def reject(*_: Any) -> Any:
        raise OperationError("joint2: 4 rad is over the limit of 3 rad")

    def break_(*_: Any) -> Any:
        raise KeyError("joint9")

    for name, handler in (("refuse", reject), ("break", break_), ("forget", lambda *_: None)):
        add_service(server, host, Trigger, name, handler, blocking=blocking)
    with capture_logs() as logs:
        rejected = caller.call(Trigger, "refuse")
        broken = caller.call(Trigger, "break")
        forgot = caller.call(Trigger, "forget")
    assert not rejected.success
    assert rejected.message == "joint2: 4 rad is over the limit of 3 rad"
    assert broken.message == "internal error: 'joint9'"
    assert not forgot.success
    raised = [log for log in logs if log.get("exc_info")]
    assert [log["service"] for log in raised] == ["break"]


def test_request_reaches_the_handler(host: RosHost, server: Node, caller: Caller) -> None:
    def handler(request: Any, response: Any) -> Any:
        response.success = True
        response.message = f"{list(request.index)} {list(request.data)}"
        return response

    add_service(server, host, SetAxis, "set_axis", handler)
    answers = [
        caller.send(SetAxis, "set_axis", SetAxis.Request(index=[i], data=[-i])) for i in range(5)
    ]
    assert [answer().message for answer in answers] == [f"[{i}] [{-i}]" for i in range(5)]


def test_flood_is_rejected(host: RosHost) -> None:
    release = threading.Event()
    for _ in range(64):
        host.submit(release.wait, WAIT_S)
    with pytest.raises(OperationError, match="robotd-worker: 64 calls are waiting already"):
        host.submit(release.wait, WAIT_S)
    release.set()


@pytest.mark.parametrize("kind", ["urgent", "until_rest"])
def test_a_stop_or_a_motion_waits_for_no_other_one(host: RosHost, kind: str) -> None:
    release, ran = threading.Event(), threading.Event()
    for _ in range(20):
        host.submit(release.wait, WAIT_S, **{kind: True})
    host.submit(ran.set, **{kind: True})
    assert ran.wait(WAIT_S / 2)
    release.set()


def test_callback_that_raises_does_not_end_the_others(
    host: RosHost, server: Node, caller: Caller
) -> None:
    add_service(server, host, Trigger, "alive", echo_thread)

    def bare(*_: Any) -> Any:
        raise RuntimeError("not caught by anybody")

    server.create_service(Trigger, "bare", bare)
    with capture_logs() as logs:
        caller.send(Trigger, "bare")
        deadline = time.monotonic() + WAIT_S
        while "a ROS callback raised" not in [log["event"] for log in logs]:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        assert caller.call(Trigger, "alive").success


def test_services_of_others_answer_where_their_callback_raises(
    host: RosHost, caller: Caller
) -> None:
    def bare(*_: Any) -> Any:
        raise RuntimeError("not caught by anybody")

    node = rclpy.create_node("plugin", context=host.context)
    node.create_service(Trigger, "bare", bare)
    host.add_node(node)
    with capture_logs() as logs:
        answer = caller.call(Trigger, "bare")
    assert (answer.success, answer.message) == (False, "internal error: not caught by anybody")
    assert [(log["event"], log["service"]) for log in logs] == [("service rejected", "/bare")]


def test_a_parameter_of_an_undefined_type_is_rejected_by_an_answer(
    host: RosHost, server: Node, caller: Caller
) -> None:
    server.declare_parameter("gain", 1.0)
    defined = Parameter("gain", value=2.0).to_parameter_msg()
    undefined = ParameterMessage(name="gain", value=ParameterValue(type=77))
    reason = "gain: 77 is not a type of a parameter"
    with capture_logs() as logs:
        together = SetParametersAtomically.Request(parameters=[defined, undefined])
        result = caller.call(
            SetParametersAtomically, "server/set_parameters_atomically", together
        ).result
        assert (result.successful, result.reason) == (False, reason)
        assert server.get_parameter("gain").value == 1.0
        request = SetParameters.Request(parameters=[undefined, defined])
        results = caller.call(SetParameters, "server/set_parameters", request).results
    assert [(one.successful, one.reason) for one in results] == [(False, reason), (True, "")]
    assert server.get_parameter("gain").value == 2.0
    assert [log.get("reason") for log in logs] == [reason]  # the second is within the same second


class SlowlyListed(Node):
    """Node whose subscriptions the executor's thread lists until ``go_on`` is set."""

    def __init__(self, host: RosHost) -> None:
        self.begun, self.go_on = threading.Event(), threading.Event()
        super().__init__("slow", context=host.context)

    @property
    def subscriptions(self) -> Any:
        self.begun.set()
        self.go_on.wait(WAIT_S)
        yield from super().subscriptions


def test_a_node_is_added_while_the_executor_iterates_over_the_others(
    host: RosHost, caller: Caller
) -> None:
    slow, late = SlowlyListed(host), rclpy.create_node("late", context=host.context)
    add_service(late, host, Trigger, "late", echo_thread)
    with capture_logs() as logs:
        host.add_node(slow)
        assert slow.begun.wait(WAIT_S)
        host.add_node(late)
        slow.go_on.set()
        assert caller.call(Trigger, "late").success
    assert not logs


class WaitingAction(WorkerAction):
    """Action whose goals run until ``ended`` is set."""

    def __init__(self, node: Node, host: RosHost) -> None:
        self.ended, self.begun = threading.Event(), threading.Semaphore(0)
        self.goals: list[Any] = []  # handles
        super().__init__(node, host, FollowJointTrajectory, "follow", get_logger("test"))

    def execute(
        self, goal: Any, result: Any, after: ExitStack, *arrived: Any
    ) -> tuple[Outcome, str]:
        self.goals.append(goal)
        self.begun.release()
        self.ended.wait(WAIT_S)
        return Outcome.SUCCEEDED, ""


def test_a_service_does_not_wait_for_goals(host: RosHost, server: Node, caller: Caller) -> None:
    action = WaitingAction(server, host)
    off: list[str] = []

    def switch_off(request: Any, response: Any) -> str:
        off.append("off")
        return "off"

    add_service(server, host, Trigger, "off", switch_off)
    client = GoalClient(caller.node, FollowJointTrajectory, "follow")
    assert client.wait_for_server(WAIT_S)
    try:
        for _ in range(2):  # as many as there are workers
            client.send_goal_async(FollowJointTrajectory.Goal())
            assert action.begun.acquire(timeout=WAIT_S)
        answer = caller.send(Trigger, "off")
        time.sleep(1.0)
        assert off
    finally:
        action.ended.set()
    assert answer().success


def test_the_content_of_a_goal_is_freed_when_it_has_ended(
    host: RosHost, server: Node, caller: Caller
) -> None:
    """Its handle stays until the result expires: 150 goals of 4 MB took 600 MiB."""
    action = WaitingAction(server, host)
    client = GoalClient(caller.node, FollowJointTrajectory, "follow")
    assert client.wait_for_server(WAIT_S)
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = ["x" * 1000]
    handle = wait_for(client.send_goal_async(goal))
    assert action.begun.acquire(timeout=WAIT_S)
    (served,) = action.goals
    assert served.request.trajectory.joint_names == ["x" * 1000]
    action.ended.set()
    wait_for(handle.get_result_async())
    assert served._goal_request is None


def test_a_goal_that_is_canceled_before_its_execution_begins_ends(
    host: RosHost, server: Node, caller: Caller
) -> None:
    action, release = WaitingAction(server, host), threading.Event()
    taken = threading.Event()

    def hold(_: Any, response: Any) -> Any:
        taken.set()
        release.wait(WAIT_S)
        return response

    add_service(server, host, Trigger, "hold", hold, blocking=False)
    client = GoalClient(caller.node, FollowJointTrajectory, "follow")
    assert client.wait_for_server(WAIT_S)
    cancel = caller.node.create_client(CancelGoal, "follow/_action/cancel_goal")
    assert cancel.wait_for_service(WAIT_S)
    held = caller.send(Trigger, "hold")
    assert taken.wait(WAIT_S)  # the executor's thread: goals and cancels arrive meanwhile
    all_goals = cancel.call_async(CancelGoal.Request())  # it is executed when the goal is accepted
    goal = client.send_goal_async(FollowJointTrajectory.Goal())
    with capture_logs() as logs:
        release.set()
        held()
        wait_for(all_goals)
        action.ended.set()
        wait_for(wait_for(goal).get_result_async())
    assert not [log for log in logs if log["event"] == "a ROS callback raised"]


def discovered_publisher(caller: Caller, kind: type, depth: int) -> Publisher:
    """Return a publisher on "topic" whose subscription is discovered."""
    publisher = caller.node.create_publisher(kind, "topic", depth)
    wait_until(publisher.get_subscription_count, "its subscription")
    return publisher


def test_message_handler_that_raises_gets_the_next_message(
    host: RosHost, server: Node, caller: Caller
) -> None:
    seen = threading.Semaphore(0)

    def handler(_: Empty) -> None:
        seen.release()
        raise RuntimeError("broken")

    add_subscription(server, host, Empty, "topic", handler, 10)
    publisher = discovered_publisher(caller, Empty, 10)
    for _ in range(3):
        publisher.publish(Empty())
    assert all(seen.acquire(timeout=WAIT_S) for _ in range(3))


def test_the_last_message_of_a_flood_is_handled(
    host: RosHost, server: Node, caller: Caller
) -> None:
    seen: list[float] = []

    def handler(message: Float64) -> None:
        time.sleep(0.001)  # 500 of them are more than the share and what is saved
        seen.append(message.data)

    add_subscription(server, host, Float64, "topic", handler, 1000)
    publisher = discovered_publisher(caller, Float64, 1000)
    for number in range(500):
        publisher.publish(Float64(data=float(number)))
    wait_until(lambda: seen[-1:] == [499.0], "the last message")
    assert len(seen) < 450
    assert seen[-1] == 499.0
    assert seen == sorted(set(seen))


@pytest.mark.parametrize(
    ("ros_args", "served"),
    [((), False), (("--ros-args", "-p", "start_type_description_service:=true"), True)],
)
def test_types_are_described_only_on_request(ros_args: tuple[str, ...], served: bool) -> None:
    """The service would write what its clients send to standard error."""
    with RosHost(ros_args) as host:
        node = rclpy.create_node("plain", context=host.context)
        host.add_node(node)
        services = node.get_service_names_and_types_by_node("plain", "/")
    assert ("/plain/get_type_description" in dict(services)) == served


def cycle_once(make_executor: Any) -> None:
    with RosHost(make_executor=make_executor) as host:
        node = rclpy.create_node("short", context=host.context)
        add_service(node, host, Trigger, "service", echo_thread)
        host.add_node(node)
        done = threading.Event()
        host.submit(done.set)
        assert done.wait(WAIT_S)


@pytest.mark.parametrize("make_executor", EXECUTORS)
def test_close_leaves_no_threads_python_or_native(make_executor: Any) -> None:
    end_idle_threads()  # of robots in earlier tests that were not shut down
    cycle_once(make_executor)  # what the middleware keeps for the whole process exists now
    before = thread_count()
    cycle_once(make_executor)
    assert [t.name for t in threading.enumerate() if t.name.startswith("robotd-")] == []
    deadline = time.monotonic() + WAIT_S
    while thread_count() > before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert thread_count() <= before


def test_close_waits_for_a_running_call_but_not_for_ever(host: RosHost) -> None:
    release, finished = threading.Event(), threading.Event()

    def quick() -> None:
        time.sleep(0.05)
        finished.set()

    host.submit(quick)
    host.submit(release.wait, WAIT_S)
    with capture_logs() as logs:
        host.close()
    release.set()
    assert finished.is_set()
    assert [(log["event"], log["count"]) for log in logs] == [("calls still run at shut-down", 1)]
    host.close()
    with pytest.raises(NotReady, match="ROS is not running"):
        host.submit(int)


def test_wrong_ros_arguments_are_an_error_of_ours() -> None:
    host = RosHost(["--ros-args", "--remap", "nonsense"])
    with pytest.raises(OperationError, match=r"ROS does not start: .*nonsense"):
        host.start()
    host.close()


SERVER = """
import signal, threading, rclpy
from robotd_ros.host import RosHost
from robotd_ros.services import add_service
from std_srvs.srv import SetBool

def handler(request, response):
    response.success, response.message = request.data, "from the other process"
    return response

stop = threading.Event()
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, lambda *_: stop.set())
with RosHost(["--ros-args", "-r", "service:=renamed"]) as host:
    node = rclpy.create_node("other", context=host.context)
    add_service(node, host, SetBool, "service", handler)
    host.add_node(node)
    stop.wait()
print("closed", [t.name for t in threading.enumerate()])
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_other_process_answers_and_ends_on_a_signal(caller: Caller, number: signal.Signals) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", SERVER],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        try:
            answer = caller.call(SetBool, "renamed", SetBool.Request(data=True))
            process.send_signal(number)
            output, _ = process.communicate(timeout=WAIT_S)
        finally:
            process.kill()
    assert (answer.success, answer.message) == (True, "from the other process")
    assert output == "closed ['MainThread']\n"
    assert process.returncode == 0


def test_nothing_of_the_middleware_stays_after_the_end() -> None:
    def threads() -> int:
        names = []
        for name in Path("/proc/self/task").glob("*/comm"):
            with suppress(OSError):  # the thread has ended meanwhile
                names.append(name.read_text())
        return sum(name.startswith("dds.") for name in names)

    def serve() -> int:
        with RosHost() as host:
            node = rclpy.create_node("asks", context=host.context)
            host.add_node(node)
            ActionClient(node, FollowJointTrajectory, "nobody")
            return threads()

    collects = gc.isenabled()
    gc.disable()
    try:
        serve()
        before = threads()  # what Fast DDS keeps for the process
        assert serve() > before
        assert threads() == before
    finally:
        if collects:
            gc.enable()


def test_the_end_of_the_context_is_reported(host: RosHost, server: Node) -> None:
    reasons: list[str] = []
    host.on_hang = reasons.append
    host.context.try_shutdown()
    deadline = time.monotonic() + 10.0
    while not reasons and time.monotonic() < deadline:
        time.sleep(0.01)
    assert reasons == ["the ROS context was shut down from outside robotd"]
