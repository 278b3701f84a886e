"""Messages to the viewers of a page, made from the tap of a robot in this process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from robotd.api import InvalidArgument
from robotd.api.features import CameraPictures, Tap
from robotd_page.live_samples import LiveSamples
from robotd_page.page_description import WorldObjects, describe
from robotd_page.page_message import Message, json_text
from robotd_page.seen_state import reduces_motion
from robotd_shared.mesh_files import MeshFiles
from robotd_shared.robot_state import Goals, event_of, state_of

FIRST_EVENTS = 300  # of the log that a new viewer gets
STATE_LOOKS = 2  # calls of ``PageFeed.messages`` with changes for one state


class PageFeed:
    """Makes each message once for all viewers. One thread; nothing runs between the calls.

    Args:
        nodes: names of the ROS nodes that are served.
        meshes: URL of each mesh, by its name in the URDF.
        has_control: the page can be unlocked to control the robot.
        has_pictures: the server has pictures of the cameras.
    """

    def __init__(
        self,
        tap: Tap,
        nodes: Sequence[str],
        meshes: Mapping[str, str],
        *,
        has_control: bool = False,
        namespace: str = "/",
        has_pictures: bool = False,
    ) -> None:
        self._tap, self._has_pictures = tap, has_pictures
        self._describe = partial(
            describe, tap, nodes, meshes, has_control=has_control, namespace=namespace
        )
        self._live = LiveSamples(tap)
        self._objects = WorldObjects(tap.robot)
        _ = tap.robot.backend.code_tables  # imported now, not at the first alarm
        self._goals = Goals(tap.robot)
        self._cursor = self._looks = 0
        self._seen = 0  # number of the newest event that reduces motion
        self._state: dict[str, Any] = {}

    def first(self, viewers: int) -> list[Message]:
        """Return the messages to a new viewer: description, past, state, events.

        Args:
            viewers: number of viewers, with the new one.
        """
        if viewers == 1:
            self._live.restart()
            self._note(*self._tap.events.since(self._cursor))
        description = self._describe()
        description["objects"] = self._objects.describe()
        description["cameras"] = self._cameras() if self._has_pictures else []
        events = self._tap.events.since(0)[0][-FIRST_EVENTS:]
        return [
            json_text(description),
            self._live.history(),
            json_text(self._read_state(viewers)),
            json_text({"type": "events", "events": [*map(event_of, events)]}),
        ]

    def messages(self, viewers: int, *, changes: bool) -> Iterator[Message]:
        """Yield the newest sample, objects that moved, and events and state where they are due."""
        if sample := self._live.sample():
            yield sample
        if moved := self._objects.moved():
            yield moved
        if changes:
            yield from self._changes(viewers)

    def _changes(self, viewers: int) -> Iterator[Message]:
        """Yield the events and the state, as far as they are new.

        The state is read with each event and else in every ``STATE_LOOKS``-th call, because it
        takes ten times as long as a sample.
        """
        events, cursor = self._tap.events.since(self._cursor)
        self._note(events, cursor)
        if events:
            yield json_text({"type": "events", "events": [*map(event_of, events[-FIRST_EVENTS:])]})
        self._looks += 1
        if not events and self._looks % STATE_LOOKS:
            return
        state = self._read_state(viewers)
        if state != self._state:
            self._state = state
            yield json_text(state)

    def repeat_state(self) -> None:
        """Yield the state with the next changes, new or not."""
        self._state = {}

    def release(self) -> None:
        """Nothing to do: nothing is computed between the calls."""

    def _cameras(self) -> list[dict[str, Any]]:
        world = self._tap.robot.world
        names = ("name", "width", "height", "rate_hz")
        return (
            [{key: getattr(each, key) for key in names} for each in world.cameras] if world else []
        )

    def _note(self, events: Sequence[Any], cursor: int) -> None:
        self._cursor = cursor
        for number, event in enumerate(events, cursor - len(events) + 1):
            self._goals.note(event)
            if reduces_motion(event):
                self._seen = number

    def _read_state(self, viewers: int) -> dict[str, Any]:
        state = state_of(self._tap, self._goals.running(), viewers)
        return {**state, "seen": self._seen}  # commands of a page return it


class RobotSource:
    """The one robot of this process, whatever name the page asks for.

    Args:
        nodes: names of the ROS nodes that are served.
        has_control: the page can be unlocked to control the robot.
    """

    def __init__(
        self,
        tap: Tap,
        nodes: Sequence[str],
        *,
        has_control: bool = False,
        namespace: str = "/",
    ) -> None:
        self._meshes = MeshFiles()
        urls = self._meshes.add(tap.urdf, tap.robot.descriptor.urdf)
        self._feed = PageFeed(
            tap, nodes, urls, has_control=has_control, namespace=namespace, has_pictures=True
        )
        world = tap.robot.world
        self._pictures = CameraPictures(world) if world is not None else None
        self._loop = tap.robot.control_loop

    def feed(self, robot: str) -> PageFeed:
        return self._feed

    def file(self, url: str) -> Path | None:
        return self._meshes.file(url)

    def picture(self, camera: str) -> bytes:
        if self._pictures is None:
            raise InvalidArgument("the robot has no cameras")
        return self._pictures.newest(camera)

    @property
    def yield_to_control_loop(self) -> Callable[[], None]:
        return self._loop.yield_to_control_loop
