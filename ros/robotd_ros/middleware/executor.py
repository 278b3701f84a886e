"""Executor of rclpy's choice for many services, and the end of its nodes.

Works around: rclpy's ``SingleThreadedExecutor`` builds a wait set of all entities for every event.
Its ``EventsExecutor`` does not, but with an endless time-out it never runs a callback in some
builds. It iterates over its nodes without a lock, so that one that is added meanwhile by another
thread ends the iteration with an error. ``Node.destroy_node`` leaves actions to the garbage
collector, and with them what they hold.
Measured: with 42 services of 7 nodes a round trip from another process takes 0.22 ms on the
EventsExecutor and 0.33 ms on the SingleThreadedExecutor; a call answered by a worker 0.27 ms and
1.1 ms (median of 400 calls, client in an EventsExecutor).
Upstream: https://github.com/ros2/rclpy/issues/1452 (cost of the wait set; closed),
https://github.com/ros2/rclpy/issues/1355 (lists of nodes without a lock; open).
Ends with: no version yet; the EventsExecutor is in rclpy from 7.1.4 on.
Shown by: tests/ros/test_middleware.py, tests/ros/test_host.py, tools/bench/middleware.py.
"""

from __future__ import annotations

from rclpy.action import ActionClient, ActionServer
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node

__all__ = ["EventsExecutor", "add_node", "destroy_node", "spin_once", "wake"]

try:
    from rclpy.experimental.events_executor import EventsExecutor
except ImportError:  # an rclpy that does not have it yet
    EventsExecutor = SingleThreadedExecutor

_SPIN_TIMEOUT_S = 1.0


def spin_once(executor: Executor) -> None:
    """Run the callbacks that are due; returns after one second where there are none.

    Raises what a callback raises, and ExternalShutdownException.
    """
    executor.spin_once(timeout_sec=_SPIN_TIMEOUT_S)


def add_node(executor: Executor, node: Node) -> None:
    """Let the thread that spins add ``node``; it is served from then on. Any thread."""
    executor.create_task(executor.add_node, node)


def wake(executor: Executor) -> None:
    """Let ``spin_once`` of another thread return."""
    executor.create_task(_nothing, None)


def destroy_node(node: Node) -> None:
    """Destroy a node and its actions. Its executor does not spin any more."""
    for waitable in [*node.waitables]:
        if isinstance(waitable, ActionClient | ActionServer):
            waitable.destroy()
    node.destroy_node()


def _nothing(_: object) -> None:
    """Task that makes an executor return to its loop."""
