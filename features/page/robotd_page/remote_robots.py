"""Robots of the ROS domain that answer, and the feed of a page from the topics of each."""

from __future__ import annotations

import json
import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String, UInt8MultiArray

from robotd.api import InvalidArgument, get_logger
from robotd_messages.cdr_stream import CdrReader
from robotd_messages.message_encoders import read_octets_message
from robotd_page.feed_topics import ALL, CHANGES, FIRST, NEWEST, SAMPLES, unpack_first
from robotd_page.live_samples import HISTORY_S, RATE_HZ
from robotd_page.page_feed import FIRST_EVENTS
from robotd_page.page_message import Message, json_text
from robotd_ros.client.operator_client import PROBLEMS
from robotd_ros.client.ros_client import Listener, RosClient
from robotd_ros.node_registry import IDENTITY
from robotd_ros.problem_messages import read_problems
from robotd_ros.qos import LATCHED
from robotd_shared.mesh_files import MeshFiles

log = get_logger("page")

SEARCH_PERIOD_S = 1.0
MAX_ROBOTS = 64
# ``FIRST`` is the last: with it the robot begins to send.
TOPICS = (
    (CHANGES, String, ALL),
    (SAMPLES, UInt8MultiArray, NEWEST),
    (FIRST, UInt8MultiArray, LATCHED),
)
PROCESS = ("computer", "pid", "wall_offset_s")  # of a description: what a restart changes
RELOAD_S = 5.0  # far longer than a robot needs to notice that nobody subscribes any more
LOST_S = 3.0  # a watched robot sends its state once a second
MAX_WAITING = 1000  # received messages
MAX_SAMPLES = round(HISTORY_S * RATE_HZ)


class RemoteFeed:
    """Messages of a remote robot for the viewers of this process.

    ``put`` is called in the thread of ROS, everything else in the one of the server.

    Args:
        name: of the robot, its namespace; "" for none, which only has the list of robots.
        robots: returns the list of robots as a message.
        folder: first part of the URLs of its meshes.
        clock: monotonic time, seconds; for tests.

    Attributes:
        name: of the robot.
        is_watched: it has viewers.
    """

    def __init__(
        self,
        name: str,
        robots: Callable[[str], str],
        folder: str,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.name = name
        self.is_watched = False
        self._released_s = -math.inf
        self._robots, self._folder, self._clock = robots, folder, clock
        self._received: deque[tuple[str, bytes]] = deque(maxlen=MAX_WAITING)
        self._meshes = MeshFiles(folder)
        self._shown_robots = ""
        self._forget()

    def _forget(self) -> None:
        self._description: dict[str, Any] = {}
        self._state = self._objects = ""
        self._samples: deque[bytes] = deque(maxlen=MAX_SAMPLES)
        self._events: deque[dict[str, Any]] = deque(maxlen=FIRST_EVENTS)
        self._received_s = self._clock()
        self._is_lost = False

    @property
    def needs_topics(self) -> bool:
        """It has viewers, or one has just gone, which may load the page again."""
        return self.is_watched or self._clock() - self._released_s < RELOAD_S

    def put(self, topic: str, data: bytes) -> None:
        """Keep a message of a topic until it is sent. Thread of ROS."""
        self._received.append((topic, data))

    def file(self, url: str) -> Path | None:
        """Return the file of a mesh of the robot; None where there is none."""
        return self._meshes.file(url)

    def first(self, viewers: int) -> list[Message]:
        """Return the list of robots, and what is known of this one."""
        if not self.needs_topics:
            self._received.clear()
            self._forget()
        self.is_watched = True
        self._shown_robots = self._robots(self.name)
        return [self._shown_robots, *self._known()]

    def messages(self, viewers: int, *, changes: bool) -> Iterator[Message]:
        """Yield what was received, and whether the robot or the list of robots has changed."""
        while self._received:
            try:
                yield from self._read(*self._received.popleft())
            except (ValueError, LookupError, TypeError) as error:
                log.warning("message of a robot not shown", robot=self.name, reason=str(error))
        if not changes:
            return
        if (robots := self._robots(self.name)) != self._shown_robots:
            self._shown_robots = robots
            yield robots
        if self.name and not self._is_lost and self._clock() - self._received_s > LOST_S:
            self._is_lost = True
            yield self._lost()

    def release(self) -> None:
        self.is_watched, self._released_s = False, self._clock()

    def _known(self) -> list[Message]:
        """Return the messages to a new viewer."""
        if not self._description:
            return [self._lost()] if self._is_lost else []
        events = {"type": "events", "events": [*self._events]}
        found: list[Message] = [json_text(self._description), b"".join(self._samples)]
        found += [self._state, json_text(events)]
        found += [self._objects] if self._objects else []
        return [*found, self._lost()] if self._is_lost else found

    def _lost(self) -> str:
        reason = f"The robot {self.name} does not answer"
        return json_text({"type": "lost", "reason": reason})

    def _read(self, topic: str, data: bytes) -> Iterator[Message]:
        """Yield the messages for viewers that follow from one of the robot."""
        self._received_s = self._clock()
        if topic == FIRST:
            if first := unpack_first(data):
                yield from self._read_first(*first)
            return
        if not self._description:
            return  # the first message is still to come
        if self._is_lost:
            self._is_lost = False
            yield from self._known()
        if topic == SAMPLES:
            samples = read_octets_message(data)
            self._samples.append(samples)
            yield samples
        elif topic == CHANGES:
            text = CdrReader(data).string()
            self._note(json.loads(text), text)
            yield text

    def _read_first(self, texts: list[dict[str, Any]], samples: bytes) -> Iterator[Message]:
        description, state, events = texts
        is_same = all(self._description.get(key) == description[key] for key in PROCESS)
        if is_same and not self._is_lost:
            return  # another page has begun to watch the same robot
        self._forget()
        self._meshes = MeshFiles(self._folder)
        path = description["urdf_file"]
        meshes = self._meshes.add(description["urdf"], Path(path) if path else None)
        self._description = {**description, "meshes": meshes}
        self._samples.append(samples)
        self._note(state, json_text(state))
        self._note(events, "")
        yield from self._known()

    def _note(self, message: Mapping[str, Any], text: str) -> None:
        match message["type"]:
            case "state":
                self._state = text
            case "objects":
                self._objects = text
            case _:
                self._events.extend(message["events"])


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
            {"name": name, "problems": known.problem_texts(), **identity}
            for name, known in sorted(self._found.items())
            if (identity := known.identity_values()) and "page" in identity.get("features", ())
        ]
        for name, feed in list(self._feeds.items()):
            if feed.needs_topics and name not in self._subscribed:
                self._subscribed[name] = self._subscribe(name, feed)
            elif not feed.needs_topics and name in self._subscribed:
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
        """Return what keeps axes from moving; None where that is not known."""
        if self.problems.newest is None:
            return None
        try:
            return [str(problem) for problem in read_problems(self.problems.newest)]
        except (ValueError, KeyError):  # of a robot of another version
            return None

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
