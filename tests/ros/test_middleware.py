"""Behaviour of rclpy and the DDS without the workarounds of ``robotd_ros.middleware``.

A test that fails after an update of ROS says that its workaround can go; the docstring of the
module names the upstream issue. Differences in time only are measured by ``make bench``.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer, get_action_names_and_types
from rclpy.node import Node
from std_msgs.msg import Empty
from tests.ros.robot_process import names_of, wait_until

from robotd_ros.host import RosHost
from robotd_ros.middleware import (
    EventsExecutor,
    destroy_node,
    overrides_of,
    shared_memory,
    use_profiles,
    with_message_info,
)
from robotd_testing.domain import own_domain

pytestmark = [pytest.mark.daily, pytest.mark.ros]

RULE = ("--ros-args", "-r", "/follow:=/remapped", "-p", "speeed:=1.0")
PARTICIPANT = """\
import rclpy
rclpy.init()
node = rclpy.create_node("short_lived")
print("up", flush=True)
input()
"""


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Iterator[Node]:
    """A node under ``RULE``, on a domain of its own, not served by an executor."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    use_profiles()
    with own_domain() as domain, RosHost(RULE, domain_id=domain) as host:
        node = Node("any", context=host.context)
        yield node
        destroy_node(node)


def received(callback: Callable[..., Any], arguments: list[tuple[Any, ...]]) -> bool:
    """Serve a subscription with ``callback`` until ``arguments`` has an item or a call raised."""
    with own_domain() as domain, RosHost(domain_id=domain) as host:
        node = Node("any", context=host.context)
        node.create_subscription(Empty, "topic", callback, 10)
        publisher = node.create_publisher(Empty, "topic", 10)
        executor = EventsExecutor(context=host.context)
        executor.add_node(node)
        publisher.publish(Empty())
        deadline = time.monotonic() + 10.0
        try:
            while not arguments and time.monotonic() < deadline:
                executor.spin_once(timeout_sec=0.1)
        except SystemError:
            return False
        finally:
            executor.shutdown()
            destroy_node(node)
        return bool(arguments)


def test_the_events_executor_calls_with_a_tuple_of_message_and_information() -> None:
    arguments: list[tuple[Any, ...]] = []
    assert not received(lambda message, info: arguments.append((message, info)), arguments)
    callback = with_message_info(lambda message, info: arguments.append((message, info)))
    assert received(callback, arguments)
    age_ns = time.time_ns() - arguments[0][1]["source_timestamp"]
    assert 0 < age_ns < 60e9


def serve_action(node: Node, name: str) -> ActionServer:
    return ActionServer(node, FollowJointTrajectory, name, lambda goal: goal)


def actions(node: Node) -> list[str]:
    return list(names_of(get_action_names_and_types(node)))


def test_rcl_does_not_remap_actions(node: Node) -> None:
    serve_action(node, "follow")
    wait_until(lambda: actions(node), "an action")
    assert actions(node) == ["/follow"]


def test_a_remapped_name_is_kept_by_rcl(node: Node) -> None:
    serve_action(node, node.resolve_topic_name("follow"))
    wait_until(lambda: actions(node), "an action")
    assert actions(node) == ["/remapped"]


def test_rclpy_ignores_an_unknown_parameter(node: Node) -> None:
    node.declare_parameter("speed", 2.0)
    assert node.get_parameter("speed").value == 2.0
    assert overrides_of(node)["speeed"].value == 1.0


@pytest.mark.parametrize(("destroy", "stays"), [(Node.destroy_node, True), (destroy_node, False)])
def test_rclpy_leaves_actions_of_a_destroyed_node(node: Node, destroy: Any, stays: bool) -> None:
    other = Node("other", context=node.context)
    server = serve_action(other, "kept")
    wait_until(lambda: "/kept" in actions(node), "the action")
    destroy(other)
    deadline = time.monotonic() + 1.0
    while "/kept" in actions(node) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert ("/kept" in actions(node)) is stays
    if stays:
        server.destroy()


def test_a_killed_process_leaves_its_shared_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_memory, "YOUNG_S", 0.0)
    before = set(shared_memory.FOLDER.glob("fastrtps_*"))
    with subprocess.Popen(
        [sys.executable, "-c", PARTICIPANT], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout
        process.stdout.readline()
        locks = [path for path in shared_memory._orphans(shared_memory.FOLDER) if path in before]
        made = set(shared_memory.FOLDER.glob("fastrtps_*_el")) - before
        process.send_signal(signal.SIGKILL)
    orphans = made & set(shared_memory._orphans(shared_memory.FOLDER))
    assert orphans, f"{made}, older orphans {locks}"
    shared_memory.remove_leftovers()
    assert not any(path.exists() for path in orphans)
