"""Feed of a page from the topics of a robot in another process."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from robotd.api import get_logger
from robotd_messages.cdr_stream import CdrReader
from robotd_messages.message_encoders import read_octets_message
from robotd_page.live_samples import HISTORY_S, RATE_HZ
from robotd_page.page_feed import FIRST_EVENTS
from robotd_page.page_message import Message, json_text
from robotd_page.page_messages import CHANGES, FIRST, SAMPLES, unpack_first
from robotd_shared.mesh_files import MeshFiles

log = get_logger("page")

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
        is_watched: it has viewers, so that its topics are wanted.
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
        self._heard_s = self._clock()
        self._is_lost = False

    def put(self, topic: str, data: bytes) -> None:
        """Keep a message of a topic until it is sent. Thread of ROS."""
        self._received.append((topic, data))

    def file(self, url: str) -> Path | None:
        """Return the file of a mesh of the robot; None where there is none."""
        return self._meshes.file(url)

    def first(self, viewers: int) -> list[Message]:
        """Return the list of robots, and what is known of this one."""
        if not self.is_watched:
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
        if self.name and not self._is_lost and self._clock() - self._heard_s > LOST_S:
            self._is_lost = True
            yield self._lost()

    def release(self) -> None:
        self.is_watched = False

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
        self._heard_s = self._clock()
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
        is_same = description["wall_offset_s"] == self._description.get("wall_offset_s")
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
