"""Service and goals of a robot where rclpy has other internals than those that are known."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from rclpy.action import CancelResponse, GoalResponse
from std_srvs.srv import Trigger
from structlog.testing import capture_logs
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import WAIT_S, wait_for, wait_until

from robotd_ros.host import RosHost
from robotd_ros.middleware import (
    RCLError,
    action_server,
    overrides_of,
    rcl_error,
    release_gil,
    request_id_of,
    start_arguments,
    worker_action_server,
)
from robotd_ros.middleware.action_server import PlainActionServer
from robotd_ros.middleware.release_gil import InternalsError
from robotd_ros.services import add_service
from robotd_testing.domain import own_domain

pytestmark = [pytest.mark.daily, pytest.mark.ros]


@pytest.fixture
def hosts(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[RosHost, RosHost]]:
    """Of the server and of the clients."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with (
        own_domain() as domain,
        RosHost(domain_id=domain) as first,
        RosHost(domain_id=domain) as second,
    ):
        yield first, second


def change_request_ids(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expect other objects of pybind11 than there are."""
    monkeypatch.setattr(release_gil, "_HEADER_BYTES", 64)


def change_messages(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expect a capsule that the classes of messages do not have."""
    monkeypatch.setattr(release_gil, "_CAPSULES", ("_CREATE_ROS_MESSAGE", "_NONE") * 2)


def change_library(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expect functions of C that rcl does not have."""

    def nothing(library: str, name: str, *_: Any) -> Any:
        raise InternalsError(f"{library}: undefined symbol: {name}")

    monkeypatch.setattr(release_gil, "c_function", nothing)
    monkeypatch.setattr("robotd_ros.middleware.goal_requests.c_function", nothing)


def change_action_server(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expect an attribute that rclpy's action server does not have."""
    internals = (*action_server._INTERNALS, (action_server.ActionServer, "take_data", "_gone"))
    monkeypatch.setattr(action_server, "_INTERNALS", internals)


@pytest.mark.parametrize(
    ("change", "warnings"), [(change_request_ids, 0), (change_messages, 1), (change_library, 1)]
)
def test_a_service_answers(
    hosts: tuple[RosHost, RosHost], monkeypatch: pytest.MonkeyPatch, change: Any, warnings: int
) -> None:
    change(monkeypatch)
    server = rclpy.create_node("server", context=hosts[0].context)
    headers: list[Any] = []

    def answer(request: Any, response: Any) -> str:
        return "hello"

    with capture_logs() as logs:
        add_service(server, hosts[0], Trigger, "asked", answer)
    monkeypatch.setattr(hosts[0], "sent_by_request", spied(hosts[0].sent_by_request, headers))
    hosts[0].add_node(server)
    client_node = rclpy.create_node("client", context=hosts[1].context)
    client = client_node.create_client(Trigger, "asked")
    hosts[1].add_node(client_node)
    assert client.wait_for_service(WAIT_S)
    for _ in range(2):
        response = wait_for(client.call_async(Trigger.Request()))
        assert response.success
        assert response.message == "hello"
    assert len([log for log in logs if "plain rclpy" in log["event"]]) == warnings
    assert (request_id_of(headers[0]) is None) == (change is change_request_ids)


def spied(function: Any, arguments: list[Any]) -> Any:
    def call(argument: Any) -> Any:
        arguments.append(argument)
        return function(argument)

    return call


@pytest.mark.parametrize("change", [change_messages, change_library, change_action_server])
def test_goals_are_executed_and_canceled(
    hosts: tuple[RosHost, RosHost], monkeypatch: pytest.MonkeyPatch, change: Any
) -> None:
    change(monkeypatch)
    serving, asking = hosts
    node, goals, canceled = rclpy.create_node("server", context=serving.context), [], []

    def cancel(goal: Any) -> CancelResponse:
        canceled.append(goal)
        return CancelResponse.ACCEPT

    def admit(request: Any) -> GoalResponse:
        named = request.goal.trajectory.joint_names
        return GoalResponse.ACCEPT if named else GoalResponse.REJECT

    with capture_logs() as logs:
        server = worker_action_server(
            node,
            FollowJointTrajectory,
            "follow",
            admit=admit,
            accepted=goals.append,
            cancel=cancel,
        )
    assert isinstance(server, PlainActionServer)
    assert ["plain rclpy" in log["event"] for log in logs] == [True]
    serving.add_node(node)
    client_node = rclpy.create_node("client", context=asking.context)
    client = GoalClient(client_node, FollowJointTrajectory, "follow")
    asking.add_node(client_node)
    assert client.wait_for_server(WAIT_S)

    wanted = FollowJointTrajectory.Goal()
    assert not wait_for(client.send_goal_async(wanted)).accepted
    wanted.trajectory.joint_names = ["joint1"]
    feedback: list[Any] = []
    handle = wait_for(client.send_goal_async(wanted, feedback.append))
    wait_until(lambda: goals, "the accepted goal")
    assert goals[0].request == wanted
    assert goals[0].status == GoalStatus.STATUS_EXECUTING
    with serving.sent_by_request(goals[0].requester):  # its sender is not known
        goals[0].publish_feedback(FollowJointTrajectory.Feedback(joint_names=["joint1"]))
    wait_until(lambda: feedback, "feedback")
    end(server, goals[0], "succeed", "there")
    answer = wait_for(handle.get_result_async())
    assert (answer.status, answer.result.error_string) == (GoalStatus.STATUS_SUCCEEDED, "there")

    handle = wait_for(client.send_goal_async(wanted))
    wait_until(lambda: len(goals) == 2, "the second goal")
    assert wait_for(handle.cancel_goal_async()).goals_canceling
    assert len(canceled) == 1
    end(server, goals[1], "canceled", "stopped")
    answer = wait_for(handle.get_result_async())
    assert (answer.status, answer.result.error_string) == (GoalStatus.STATUS_CANCELED, "stopped")


def test_another_extension_module(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rclpy._rclpy_pybind11", None)
    names = runpy.run_path(rcl_error.__file__)
    assert names["RCLError"] is RuntimeError
    assert issubclass(RCLError, RuntimeError)


def test_hidden_overrides_are_none_with_one_warning() -> None:
    start_arguments._hidden_overrides.cache_clear()
    with capture_logs() as logs:
        assert not overrides_of(SimpleNamespace())
        assert not overrides_of(SimpleNamespace())
    assert ["plain rclpy" in log["event"] for log in logs] == [True]


def end(server: Any, goal: Any, how: str, text: str) -> None:
    def finish(goal: Any) -> Any:
        getattr(goal, how)()
        return FollowJointTrajectory.Result(error_string=text)

    server.notify_execute(goal, finish)
