"""Stream of a joint group that is fed by a topic."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from robotd.control.open_stream import OpenStream
from robotd.errors import RobotdError
from robotd.ros.host import RosHost
from robotd.ros.nodes.rejection_log import RejectionLog

Stream = TypeVar("Stream", bound=OpenStream[Any])


class TopicStream(Generic[Stream]):
    """Applies commands to a stream that a worker opens for the first of them.

    The stream ends by itself when no message comes; the joints then have no owner. A rejection
    is logged once for each kind. ``apply`` and ``stop`` for the executor thread.

    Args:
        open_stream: returns an open stream, which ends without commands. Worker.
        host: its workers open and close streams.
        topic: name, for the log.
    """

    def __init__(self, open_stream: Callable[[], Stream], host: RosHost, topic: str) -> None:
        self._open_stream, self._host, self._topic = open_stream, host, topic
        self._rejections = RejectionLog()
        self._lock = threading.Lock()  # of the three below
        self._stream: Stream | None = None
        self._waiting: Callable[[Stream], None] | None = None
        self._opening = False

    def apply(self, command: Callable[[Stream], None]) -> None:
        """Run ``command`` with the open stream, or open one for it; a rejection is logged."""
        with self._lock:
            stream = self._stream
            if stream is None:
                self._waiting = command
                if self._opening:
                    return
                self._opening = True
        try:
            if stream is None:
                self._host.submit(self._run)
            else:
                command(stream)
                self._rejections.accepted(self._topic, ())
        except RobotdError as error:  # NotReady: it is ending, the next message opens another one
            if stream is None:
                with self._lock:
                    self._opening = False
            self._rejections.rejected(self._topic, (), str(error))

    def stop(self) -> None:
        """End the stream: the joints slow to rest."""
        with self._lock:
            self._waiting, stream = None, self._stream
        if stream is not None:
            stream.end("stopped by the client")

    def _run(self) -> None:
        """Worker: open a stream, run it to its end, and give the joints back."""
        try:
            stream = self._open_stream()
        except Exception as error:
            with self._lock:  # the next message opens another one
                self._opening, self._waiting = False, None
            if not isinstance(error, RobotdError):
                raise
            self._rejections.rejected(self._topic, (), str(error))
            return
        with stream:
            with self._lock:
                command, self._waiting = self._waiting, None
                self._stream, self._opening = stream, False
            try:
                if command is not None:
                    with self._rejections.noting(self._topic):
                        command(stream)
                stream.wait()
            finally:
                with self._lock:
                    self._stream = None
