"""Responses to clients that have ended or are not discovered yet."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger
from tests.ros.robot_process import WAIT_S, wait_for, wait_until

from robotd_ros.host import RosHost
from robotd_ros.middleware import service_responses
from robotd_ros.services import add_service

pytestmark = [pytest.mark.daily, pytest.mark.ros]

BURST = 30  # 3 s, if each were waited for


@pytest.fixture
def hosts(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[RosHost, RosHost]]:
    """Of the server and of the clients."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(os.getpid() % 100))
    with RosHost() as first, RosHost() as second:
        yield first, second


def node_of(host: RosHost, name: str) -> Node:
    node = rclpy.create_node(name, context=host.context)
    host.add_node(node)
    return node


def ask(client: Any) -> Any:
    assert client.wait_for_service(WAIT_S)
    return client.call_async(Trigger.Request())


def greet(_: Any, response: Any) -> Any:
    response.message = "hello"
    return response


class Busy:
    """Server with a blocked executor thread and calls of a client that has ended.

    Attributes:
        node: of the clients.
        held: the answer to the call that holds it.
    """

    def __init__(self, hosts: tuple[RosHost, RosHost], calls: int, *, blocking: bool) -> None:
        self._release, taken = threading.Event(), threading.Event()
        self.server, self.node = node_of(hosts[0], "server"), node_of(hosts[1], "client")

        def hold(request: Any, response: Any) -> Any:
            taken.set()
            self._release.wait(WAIT_S)
            return greet(request, response)

        add_service(self.server, hosts[0], Trigger, "held", hold, blocking=False)
        add_service(self.server, hosts[0], Trigger, "asked", greet, blocking=blocking)
        hasty = self.node.create_client(Trigger, "asked", qos_profile=QoSProfile(depth=BURST))
        self.held = ask(self.node.create_client(Trigger, "held"))
        assert taken.wait(WAIT_S)
        for _ in range(calls):
            ask(hasty)
        self.node.destroy_client(hasty)
        gone = "the server to know that it has gone"
        wait_until(lambda: not self.server.count_clients("asked"), gone)

    def release(self) -> None:
        self._release.set()


@pytest.mark.parametrize("blocking", [True, False])
def test_clients_that_have_gone_hold_up_nobody(
    hosts: tuple[RosHost, RosHost], blocking: bool
) -> None:
    busy = Busy(hosts, BURST, blocking=blocking)
    honest = ask(busy.node.create_client(Trigger, "asked"))
    began_s = time.monotonic()
    busy.release()
    assert wait_for(honest).message == wait_for(busy.held).message == "hello"
    assert time.monotonic() - began_s < 0.1 * BURST / 2


@pytest.mark.long
def test_rmw_fastrtps_waits_for_clients_that_have_gone(
    hosts: tuple[RosHost, RosHost], monkeypatch: pytest.MonkeyPatch
) -> None:
    def send(self: Any, response: Any, header: Any) -> None:
        self._rclpy_send(response, header)

    monkeypatch.setattr(service_responses.ServiceResponses, "send", send)
    busy = Busy(hosts, BURST, blocking=False)
    honest = ask(busy.node.create_client(Trigger, "asked"))
    began_s = time.monotonic()
    busy.release()
    assert wait_for(honest).message == "hello"
    assert time.monotonic() - began_s > 0.1 * BURST / 2  # else the module can go


@pytest.mark.parametrize("late_s", [0.05, 1.5])
def test_a_client_that_is_not_known_yet_gets_its_answer(
    late_s: float, hosts: tuple[RosHost, RosHost], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Discovery on a busy computer takes more than a second."""
    look = Node.get_subscriptions_info_by_topic
    times_s: list[float] = []

    def late(*arguments: Any, **options: Any) -> Any:
        times_s.append(time.monotonic())
        found = look(*arguments, **options)
        return found if times_s[-1] - times_s[0] > late_s else []

    monkeypatch.setattr(Node, "get_subscriptions_info_by_topic", late)
    add_service(node_of(hosts[0], "server"), hosts[0], Trigger, "asked", greet)
    client = node_of(hosts[1], "client").create_client(Trigger, "asked")
    assert wait_for(ask(client)).message == "hello"
    assert times_s[-1] - times_s[0] > late_s, "the answer did not wait for the client"


def test_a_response_that_cannot_be_sent_holds_up_no_other(
    hosts: tuple[RosHost, RosHost], monkeypatch: pytest.MonkeyPatch
) -> None:
    look, release = Node.get_subscriptions_info_by_topic, threading.Event()

    def late(*arguments: Any, **options: Any) -> Any:
        return look(*arguments, **options) if release.is_set() else []

    def greet_in_turn(request: Any, response: Any) -> Any:
        asked.append(request)
        response.message = "\ud800" if len(asked) == 1 else "hello"
        return response

    asked: list[Any] = []
    monkeypatch.setattr(Node, "get_subscriptions_info_by_topic", late)
    add_service(node_of(hosts[0], "server"), hosts[0], Trigger, "asked", greet_in_turn)
    client = node_of(hosts[1], "client").create_client(Trigger, "asked")
    _, answered = ask(client), ask(client)
    wait_until(lambda: len(asked) == 2, "both requests to be waiting")
    release.set()
    assert wait_for(answered).message == "hello"
    assert wait_for(ask(client)).message == "hello"


def test_a_response_that_waits_for_a_client_that_has_gone_leaves_the_interpreter_alone(
    hosts: tuple[RosHost, RosHost], monkeypatch: pytest.MonkeyPatch
) -> None:
    busy, ended = Busy(hosts, BURST // 3, blocking=False), threading.Event()

    def last(_: Any, response: Any) -> Any:
        ended.set()
        return response

    add_service(busy.server, hosts[0], Trigger, "last", last, blocking=False)
    monkeypatch.setattr(
        service_responses._Waiting, "can_be_sent", lambda *_: True
    )  # the graph is behind
    ask(busy.node.create_client(Trigger, "last"))
    busy.release()
    turns = 0
    while not ended.is_set():
        time.sleep(0.001)
        turns += 1
    assert turns > 10 * BURST, "this thread did not get the interpreter"  # 90 a send; locked, 15
