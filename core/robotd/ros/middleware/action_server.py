"""Action server that keeps results for a span of real time, also in simulated time.

Works around: rclpy expires results by the node's clock. At ``--time-scale max`` 10 s of that are
0.3 s of real time, and a client that asks for a result later than that gets UNKNOWN.
Measured: 17 of 70 goals lost their results.
Upstream: none known for the clock; https://github.com/ros2/rcl/issues/1103 (closed) is about the
start of the time-out.
Shown by: tests/ros/test_simulated_time.py.
"""

from __future__ import annotations

from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from robotd.ros.middleware.action_requests import PromptActionServer


class RealTimeResultServer(PromptActionServer):
    """``ActionServer`` whose ``result_timeout`` is real time; stamps are of the node's clock."""

    def __init__(self, node: Node, *arguments: Any, **options: Any) -> None:
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)  # rcl keeps a bare pointer
        super().__init__(_NodeOnClock(node, self._steady_clock), *arguments, **options)
        self._node = node


class _NodeOnClock:
    """``node`` with another clock, while the server is made."""

    def __init__(self, node: Node, clock: Clock) -> None:
        self._wrapped = node
        self._clock = clock

    def __getattr__(self, name: str) -> Any:
        return getattr(self._wrapped, name)

    def get_clock(self) -> Clock:
        return self._clock
