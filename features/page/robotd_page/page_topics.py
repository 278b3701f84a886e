"""Topics for pages in other processes, on the node ``robotd``; silent without subscribers."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Self

from rclpy.node import Node
from std_msgs.msg import String, UInt8MultiArray

from robotd.api import get_logger
from robotd.api.features import Tap
from robotd_messages.message_encoders import octets_message, string_message
from robotd_page.feed_topics import ALL, CHANGES, FIRST, NEWEST, SAMPLES, pack_first
from robotd_page.page_feed import PageFeed
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.qos import LATCHED
from robotd_ros.run_nodes import NodeContext

log = get_logger("page")

SILENT_PERIOD_S = 0.5  # between two checks for subscribers
RATE_HZ = 15.0  # half of the page inside the process: a sample costs more
CHANGES_TICKS = 2  # of ``RATE_HZ``: state, events, and a look for subscribers
STATE_TICKS = 14  # the state is repeated, as a sign of life


@contextmanager
def add_topics(context: NodeContext, tap: Tap) -> Iterator[None]:
    """Publish what a page in another process shows, while the nodes run."""
    with PageTopics(context.operator, tap, context.node_names):
        yield


class PageTopics:
    """Publishes what a page shows: ``with PageTopics(...):``. Its thread is ``robotd-page-topics``.

    Args:
        node: the one of the operator.
        nodes: names of the ROS nodes that are served.
    """

    def __init__(self, node: Node, tap: Tap, nodes: Sequence[str]) -> None:
        self._feed = PageFeed(tap, nodes, {}, namespace=node.get_namespace())
        self._yield_to_control_loop = tap.robot.control_loop.yield_to_control_loop
        self._first = node.create_publisher(UInt8MultiArray, FIRST, LATCHED)
        self._samples = node.create_publisher(UInt8MultiArray, SAMPLES, NEWEST)
        self._changes = node.create_publisher(String, CHANGES, ALL)
        self._subscribers = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="robotd-page-topics", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        tick, due_s = 0, 0.0
        try:
            while True:
                period_s = 1.0 / RATE_HZ if self._subscribers else SILENT_PERIOD_S
                due_s = max(due_s + period_s, time.monotonic())
                if self._stop.wait(due_s - time.monotonic()):
                    return
                self._yield_to_control_loop()
                if tick % CHANGES_TICKS == 0 or not self._subscribers:
                    self._look_for_subscribers()
                if self._subscribers:
                    self._publish(tick)
                tick += 1
        except Exception:
            log.exception("the topics of the page have ended")

    def _look_for_subscribers(self) -> None:
        """Publish the first message for a new subscriber, and clear it after the last one."""
        before, self._subscribers = self._subscribers, self._first.get_subscription_count()
        if self._subscribers > before:
            data = pack_first(self._feed.first(self._subscribers))
        elif before and not self._subscribers:
            data = octets_message(b"")
        else:
            return
        publish_if_alive(self._first, data)

    def _publish(self, tick: int) -> None:
        if tick % STATE_TICKS == 0:
            self._feed.repeat_state()
        changes = tick % CHANGES_TICKS == 0
        for message in self._feed.messages(self._subscribers, changes=changes):
            if isinstance(message, bytes):
                publish_if_alive(self._samples, octets_message(message))
            else:
                publish_if_alive(self._changes, string_message(message))
