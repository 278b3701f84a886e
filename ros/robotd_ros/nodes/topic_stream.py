"""Stream of a joint group that is fed by a topic."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from robotd.control.groups.streams import OpenStream, StreamClient
from robotd.errors import RobotdError
from robotd_ros.host import RosHost
from robotd_ros.nodes.command_subscription import RejectionLog

Stream = TypeVar("Stream", bound=OpenStream[Any])


class TopicStream(Generic[Stream]):
    """Applies commands to a stream that a worker opens for the first of them.

    The stream ends by itself when no message comes; the joints then have no owner. None is opened
    for a command that is rejected. A rejection is logged once for each kind. ``apply`` and ``stop``
    for the executor thread.

    Args:
        client: opens streams, which end without commands.
        host: its workers open and close streams.
        topic: name, for the log.
    """

    def __init__(self, client: StreamClient[Stream], host: RosHost, topic: str) -> None:
        self._client, self._host, self._topic = client, host, topic
        self._rejections = RejectionLog(host)
        self._lock = threading.Lock()  # of the three below
        self._stream: Stream | None = None
        self._waiting: Any = None  # command
        self._opening = False

    @property
    def is_open(self) -> bool:
        """A stream is open: the joints belong to it. Any thread."""
        return self._stream is not None

    def apply(self, make: Callable[..., Any], *given: Any) -> None:
        """Give a command to the open stream, or open one; log a rejection.

        Args:
            make: returns the command; called with the stream's ``StreamCommands`` and ``given``.
            given: a message, and when it was sent, for example.
        """
        try:
            command = make(self._client.commands, *given)
            if self._stream is None:
                self._client.commands.check_opening(command)
            with self._lock:
                stream, is_first = self._stream, not self._opening
                if stream is None:
                    self._waiting, self._opening = command, True
            if stream is not None:
                stream.put(command)
                self._rejections.accepted(self._topic, ())
            elif is_first:
                self._open()
        except RobotdError as error:  # NotReady: it is ending, the next message opens another one
            self._rejections.rejected(self._topic, (), str(error))

    def stop(self) -> None:
        """End the stream: the joints slow to rest. It is a command without motion."""
        self._client.commands.source.admit(moves=False)
        with self._lock:
            self._waiting, stream = None, self._stream
        if stream is not None:
            stream.end("stopped by the client")

    def _open(self) -> None:
        """Let a worker open a stream for the waiting command. Raises RobotdError."""
        try:
            self._host.submit(self._run, until_rest=True)
        except RobotdError:
            with self._lock:
                self._opening = False
            raise

    def _run(self) -> None:
        """Worker: open a stream, run it to its end, and give the joints back."""
        try:
            stream = self._client.open()
        except Exception as error:
            with self._lock:  # the next message opens another one
                self._opening, self._waiting = False, None
            if not isinstance(error, RobotdError):
                raise
            self._rejections.rejected(self._topic, (), str(error))
            return
        with stream:
            try:
                with self._lock:  # until it has the waiting command: a newer one comes after it
                    command, self._waiting = self._waiting, None
                    self._stream, self._opening = stream, False
                    if command is not None:
                        with self._rejections.noting(self._topic):
                            # Motion may have been rejected since the command was made.
                            self._client.commands.source.admit(moves=True)
                            stream.put(command)
                stream.wait()
            finally:
                with self._lock:
                    self._stream = None
