"""Stamps follow the node's clock, also when it changes over to simulated time and back."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time

from robotd_ros.middleware.stamp_clock import StampClock

pytestmark = [pytest.mark.daily, pytest.mark.ros]


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Iterator[Node]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    context = Context()
    rclpy.init(args=[], context=context)
    node = rclpy.create_node("test_stamp", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def follow_topic(node: Node, follows: bool) -> None:
    node.set_parameters([Parameter("use_sim_time", value=follows)])


def simulate(node: Node, time_ns: int) -> None:
    clock = node.get_clock()
    clock.set_ros_time_override(Time(nanoseconds=time_ns, clock_type=clock.clock_type))


def test_it_is_the_time_of_the_system(node: Node) -> None:
    clock = StampClock(node.get_clock())
    before, now, after = time.time_ns(), clock.now_ns(), time.time_ns()
    assert before <= now <= after


def test_a_moment_of_the_monotonic_clock_keeps_its_distance_from_now(node: Node) -> None:
    clock, moment_ns = StampClock(node.get_clock()), time.monotonic_ns() - 10**9
    before, stamp, after = time.time_ns(), clock.at_ns(moment_ns), time.time_ns()
    # Two clocks are read one after the other; a stall between them is allowed for.
    assert before - 2 * 10**9 < stamp < after - 10**9 + 10**6
    follow_topic(node, True)
    simulate(node, 42)
    assert clock.at_ns(moment_ns) == 42


def test_it_changes_over_to_simulated_time_and_back(node: Node) -> None:
    clock = StampClock(node.get_clock())
    follow_topic(node, True)
    simulate(node, 42)
    assert clock.now_ns() == 42
    follow_topic(node, False)
    assert clock.now_ns() == pytest.approx(time.time_ns(), abs=10**10)


def test_it_knows_a_clock_that_is_simulated_already(node: Node) -> None:
    follow_topic(node, True)
    simulate(node, 42)
    assert StampClock(node.get_clock()).now_ns() == 42
