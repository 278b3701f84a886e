"""Feeds that a page can show, and the viewers of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Protocol

from robotd_page.page_message import Message, websocket_frames
from robotd_page.viewers import Viewer


class Feed(Protocol):
    """Messages of one robot for its viewers. Called in the server's thread."""

    def first(self, viewers: int) -> list[Message]:
        """Return the messages to a new viewer.

        Args:
            viewers: number of viewers, with the new one.
        """
        ...

    def messages(self, viewers: int, *, changes: bool) -> Iterable[Message]:
        """Yield what is new, called at ``RATE_HZ`` while there are viewers.

        Args:
            viewers: number of viewers.
            changes: besides the samples, everything else is due too.
        """
        ...

    def release(self) -> None:
        """Called when the last viewer has gone."""
        ...


class PageSource(Protocol):
    """Feeds by the name of a robot, and the files that they name."""

    def feed(self, robot: str) -> Feed:
        """Return the feed of a robot, the same object each time.

        Args:
            robot: as the page asks for it; "" where it names none.
        """
        ...

    def file(self, url: str) -> Path | None:
        """Return the mesh at a path of the server; None where there is none."""
        ...

    def picture(self, camera: str) -> bytes:
        """Return the newest picture as JPEG. Blocks; any thread.

        Raises InvalidArgument for an unknown camera, OperationError without OpenGL or Pillow.
        """
        ...

    @property
    def yield_to_control_loop(self) -> Callable[[], None]:
        """Called before the server takes the interpreter."""
        ...


class Channel:
    """Viewers of one feed: each frame is made once. Thread of the server.

    Args:
        feed: source of the messages.

    Attributes:
        viewers: at present.
    """

    def __init__(self, feed: Feed) -> None:
        self._feed = feed
        self.viewers: set[Viewer] = set()

    def first(self) -> bytes:
        """Return the first frames to one more viewer."""
        return websocket_frames(self._feed.first(len(self.viewers) + 1))

    def publish(self, *, changes: bool) -> None:
        """Send the newest samples, and the changes where they are due."""
        if frames := websocket_frames(self._feed.messages(len(self.viewers), changes=changes)):
            for viewer in self.viewers:
                viewer.send(frames)

    def discard(self, viewer: Viewer) -> None:
        """Remove a viewer that has gone."""
        self.viewers.discard(viewer)
        if not self.viewers:
            self._feed.release()
