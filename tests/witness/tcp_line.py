"""TCP connections in simulated time between backend ``dobot`` and the stand-in of a controller.

Bytes are in order and are not lost: while the cable is cut they wait, and arrive when it is healed,
as TCP sends them again. A client that closes its connection discards what has not arrived.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

PATIENCE_S = 20.0  # real time for the receiver to take what has arrived


class TcpLine:
    """Cable to a controller, and what waits at its ends. One thread but for the receiver.

    Args:
        now_s: simulated time.
        obey: executes the text of a command and returns its reply.

    Attributes:
        cut_s: the cable is cut until then.
        busy_s: the controller reads no command until then.
        mute_s: it sends no feedback until then.
        sent_s: when the target that is executed now was sent.
    """

    def __init__(self, now_s: Callable[[], float], obey: Callable[[str], str]) -> None:
        self.now_s, self.obey = now_s, obey
        self.cut_s = self.busy_s = self.mute_s = self.sent_s = 0.0
        self.connections: list[Connection] = []

    @property
    def is_cut(self) -> bool:
        return self.now_s() < self.cut_s

    def connect(self, address: tuple[str, int], timeout_s: float) -> Connection:
        """As ``socket.create_connection``; ports are those of the backend's defaults."""
        if self.is_cut:
            raise TimeoutError("timed out")
        connection = Connection(self, ROLES[address[1]])
        self.connections.append(connection)
        return connection

    def advance(self) -> None:
        """Deliver what has waited."""
        if self.is_cut:
            return
        for connection in list(self.connections):
            connection.deliver()

    def report(self, packet: bytes) -> None:
        """Send a packet of feedback, and wait until it has been taken."""
        if self.now_s() < self.mute_s:
            return
        for connection in list(self.connections):
            if connection.role == "feedback":
                connection.waiting.append((self.now_s(), packet))
                connection.deliver()

    def abort(self) -> None:
        """End all connections, as a controller that is switched off and on."""
        for connection in list(self.connections):
            connection.end()


class Connection:
    """The client's end, with the methods of a socket that the backend uses."""

    def __init__(self, line: TcpLine, role: str) -> None:
        self.line, self.role = line, role
        self.waiting: deque[tuple[float, bytes]] = deque()  # on their way, with the time of sending
        self._received = bytearray()
        self._changed = threading.Condition()
        self._idle = self._ended = False

    def setsockopt(self, *_: Any) -> None:
        """Nothing waits for more, and a close discards."""

    def setblocking(self, _: bool) -> None:
        """Only the feedback is waited for."""

    def send(self, data: bytes) -> int:
        if self._ended:
            raise ConnectionError("closed")
        self.waiting.append((self.line.now_s(), data))
        if not self.line.is_cut:
            self.deliver()
        return len(data)

    def recv(self, size: int) -> bytes:
        with self._changed:
            if self.role == "feedback":
                self._idle = True
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._received or self._ended)
                self._idle = False
            if self._received:
                taken = bytes(self._received[:size])
                del self._received[:size]
                return taken
            if self._ended:
                return b""
        raise BlockingIOError

    def shutdown(self, _: int) -> None:
        self.end()

    def close(self) -> None:
        self.end()

    def end(self) -> None:
        if self in self.line.connections:
            self.line.connections.remove(self)
        with self._changed:
            self._ended = True
            self.waiting.clear()
            self._changed.notify_all()

    def deliver(self) -> None:
        """Carry what waits to its end, unless the cable or the controller does not take it."""
        if self.line.is_cut or (self.role == "commands" and self.line.now_s() < self.line.busy_s):
            return
        while self.waiting:
            self.line.sent_s, data = self.waiting.popleft()
            answer = data if self.role == "feedback" else self.line.obey(data.decode()).encode()
            with self._changed:
                self._received += answer
                self._changed.notify_all()
        if self.role == "feedback":
            with self._changed:
                self._changed.wait_for(
                    lambda: self._ended or (self._idle and not self._received), PATIENCE_S
                )


ROLES = {29999: "commands", 30004: "feedback"}
