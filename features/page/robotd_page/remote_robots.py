"""Robots of the ROS domain that answer, and their pages."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String, UInt8MultiArray

from robotd.api import InvalidArgument, get_logger
from robotd_page.page_message import json_text
from robotd_page.page_messages import ALL, CHANGES, FIRST, NEWEST, SAMPLES
from robotd_page.remote_feed import RemoteFeed
from robotd_ros.client.operator_client import PROBLEMS
from robotd_ros.client.ros_client import Listener, RosClient
from robotd_ros.node_registry import IDENTITY
from robotd_ros.problem_messages import read_problems
from robotd_ros.qos import LATCHED

log = get_logger("page")

SEARCH_PERIOD_S = 1.0
MAX_ROBOTS = 64
# ``FIRST`` is the last: with it the robot begins to send.
TOPICS = (
    (CHANGES, String, ALL),
    (SAMPLES, UInt8MultiArray, NEWEST),
    (FIRST, UInt8MultiArray, LATCHED),
)


class RemoteRobots:
    """Source of the page of all robots in the ROS domain.

    ``update`` belongs to the thread of the client; ``feed`` and ``file`` to the one of the server.

    Args:
        client: started, with ``searches``.
    """

    def __init__(self, client: RosClient) -> None:
        self._client = client
        self._found: dict[str, _Known] = {}  # by namespace
        self._subscribed: dict[str, ExitStack] = {}
        self._feeds: dict[str, RemoteFeed] = {}
        self._directory = RemoteFeed("", self._message, "/mesh/-/")
        self._robots: list[dict[str, Any]] = []
        self._due_s = 0.0

    def feed(self, robot: str) -> RemoteFeed:
        """Return the feed of a robot, or the list alone where none answers."""
        if not any(each["name"] == robot for each in self._robots):
            return self._feeds.get(robot, self._directory)
        if robot not in self._feeds:
            folder = f"/mesh/{len(self._feeds)}/"
            self._feeds[robot] = RemoteFeed(robot, self._message, folder)
        return self._feeds[robot]

    def file(self, url: str) -> Path | None:
        found = (feed.file(url) for feed in self._feeds.values())
        return next((file for file in found if file), None)

    def picture(self, camera: str) -> bytes:
        raise InvalidArgument("pictures of other processes are not served")

    @property
    def yield_to_control_loop(self) -> Callable[[], None]:
        return lambda: None  # no control loop runs in this process

    def update(self) -> None:
        """Look for robots, and subscribe those that are watched."""
        if time.monotonic() >= self._due_s:
            self._due_s = time.monotonic() + SEARCH_PERIOD_S
            self._search()
        self._robots = [
            {"name": name, "problems": known.problem_texts(), **told}
            for name, known in sorted(self._found.items())
            if (told := known.identity_values()) and "page" in told.get("features", ())
        ]
        for name, feed in list(self._feeds.items()):
            if feed.is_watched and name not in self._subscribed:
                self._subscribed[name] = self._subscribe(name, feed)
            elif not feed.is_watched and name in self._subscribed:
                self._subscribed.pop(name).close()

    def close(self) -> None:
        """End all subscriptions."""
        for subscriptions in self._subscribed.values():
            subscriptions.close()
        for known in self._found.values():
            known.close()

    def _search(self) -> None:
        node = self._client.node
        names = {
            topic.removesuffix(f"/{IDENTITY}") or "/"
            for topic, _ in node.get_topic_names_and_types()
            if topic.endswith(f"/{IDENTITY}") and node.count_publishers(topic)
        }
        for name in self._found.keys() - names:
            log.info("robot has gone", robot=name)
            self._found.pop(name).close()
        for name in sorted(names - self._found.keys())[: MAX_ROBOTS - len(self._found)]:
            log.info("robot found", robot=name)
            identity, problems = (
                self._client.listen(kind, _topic(name, topic), LATCHED)
                for kind, topic in ((String, IDENTITY), (DiagnosticArray, PROBLEMS))
            )
            self._found[name] = _Known(identity, problems)

    def _subscribe(self, name: str, feed: RemoteFeed) -> ExitStack:
        stack, node = ExitStack(), self._client.node
        for topic, kind, qos in TOPICS:
            receive = partial(feed.put, topic)
            made = node.create_subscription(kind, _topic(name, topic), receive, qos, raw=True)
            stack.callback(node.destroy_subscription, made)
        return stack

    def _message(self, shown: str) -> str:
        """Return the list of robots, for a page that shows ``shown`` of them."""
        return json_text({"type": "robots", "shown": shown, "robots": self._robots})


@dataclass(frozen=True)
class _Known:
    """Latched topics of a robot that was found."""

    identity: Listener
    problems: Listener

    def identity_values(self) -> dict[str, Any]:
        """Return what the robot says of itself; empty before that."""
        return _read(self.identity.newest.data) if self.identity.newest else {}

    def problem_texts(self) -> list[str] | None:
        """Return what keeps axes from moving; None before the robot has said it."""
        if self.problems.newest is None:
            return None
        return [str(problem) for problem in read_problems(self.problems.newest)]

    def close(self) -> None:
        for listener in (self.identity, self.problems):
            listener.__exit__()


def _topic(robot: str, topic: str) -> str:
    return f"{robot.rstrip('/')}/{topic}"


def _read(text: str) -> dict[str, Any]:
    """Return what a robot says of itself; nothing for what is not readable."""
    try:
        found = json.loads(text)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}
