"""Connections for commands. Nothing here waits, so that the control loop may send."""

from __future__ import annotations

import fcntl
import socket
import struct
import termios
import threading
from abc import ABC, abstractmethod
from collections import deque
from contextlib import suppress

from robotd.api import NANOSECONDS, Clock, NotReady, OperationError, wait_until
from robotd_dobot.protocol import REPLY_END, parse_reply

ABORT = struct.pack("ii", 1, 0)  # SO_LINGER: a close discards what is not sent, and resets the peer
MAX_REPLY = 65_536  # bytes without an end
MAX_WAITING = 1000  # targets; the oldest ends the connection long before


class Request:
    """A command that was sent.

    Attributes:
        reply: text of the answer; None before it.
    """

    def __init__(self, name: str, sent_ns: int) -> None:
        self.name, self.sent_ns = name, sent_ns
        self.reply: str | None = None


class TargetPort(ABC):
    """Takes targets, and knows how long the oldest of them has waited.

    Args:
        discards: what the controller has not read is discarded at both ends when this is closed.

    Attributes:
        rejection: why the controller has not executed the last target; "": it has.
        rejected_ns: since when it has executed none.
    """

    def __init__(self, connection: socket.socket, clock: Clock, *, discards: bool = True) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if discards:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, ABORT)
        connection.setblocking(False)
        self.rejection, self.rejected_ns = "", 0
        self._connection, self._clock = connection, clock
        self._received = b""
        self._lock = threading.Lock()  # never held while waiting

    def send_target(self, text: str) -> None:
        """Send a target. Raises OSError: it cannot be sent at once and whole."""
        with self._lock:
            self._send_target(text)

    def target_age_s(self) -> float:
        """Return for how long the controller has not taken the oldest target; 0: it has taken all.

        Takes the replies that are here. Raises OSError: the connection has ended.
        """
        with self._lock:
            self._receive()
            return (self._clock.now_ns() - self._oldest_ns()) / NANOSECONDS

    def close(self) -> None:
        """End the connection, without a shutdown, which would send what is to be discarded."""
        self._connection.close()

    @abstractmethod
    def _send_target(self, text: str) -> None: ...

    @abstractmethod
    def _oldest_ns(self) -> int:
        """Return when the oldest target was sent that the controller has not taken; else now."""

    @abstractmethod
    def _take_reply(self, reply: str) -> None: ...

    def _send(self, text: str) -> None:
        data = text.encode("ascii")
        if self._connection.send(data) < len(data):
            raise BlockingIOError("the controller does not read them")

    def _receive(self) -> None:
        """Take the replies that are here. Raises OSError: the connection has ended."""
        with suppress(BlockingIOError):
            while True:
                part = self._connection.recv(4096)
                if not part:
                    raise ConnectionError("closed by the controller")
                self._received += part
        while found := REPLY_END.match(self._received):
            self._received = self._received[found.end() :]
            self._take_reply(found[0].decode("ascii", "replace"))
        if len(self._received) > MAX_REPLY:
            raise ConnectionError(f"a reply of more than {MAX_REPLY} bytes")

    def _judge_target(self, reply: str) -> None:
        try:
            parse_reply(reply, "ServoJ")
        except (NotReady, OperationError) as error:
            if not self.rejection:
                self.rejected_ns = self._clock.now_ns()
            self.rejection = str(error)
        else:
            self.rejection = ""


class CommandPort(TargetPort):
    """Commands, and targets of V4: each is answered, in their order. Any thread."""

    def __init__(self, connection: socket.socket, clock: Clock, *, discards: bool = True) -> None:
        super().__init__(connection, clock, discards=discards)
        self._waiting: deque[Request] = deque()
        self._targets: deque[Request] = deque()  # those of them that are targets

    def post(self, text: str) -> Request:
        """Send a command without waiting. Raises OSError: it cannot be sent at once and whole."""
        with self._lock:
            return self._post(text)

    def call(self, text: str, timeout_s: float) -> str:
        """Send a command and return its reply, as text.

        Raises OSError: it cannot be sent, or no reply came.
        """
        request = self.post(text)
        if not wait_until(lambda: self.is_answered(request), timeout_s, self._clock):
            raise TimeoutError(f"waited {timeout_s:g} s")
        return request.reply or ""

    def is_answered(self, request: Request) -> bool:
        """Take the replies that are here. Raises OSError: the connection has ended."""
        with self._lock:
            self._receive()
        return request.reply is not None

    def _post(self, text: str) -> Request:
        request = Request(text.partition("(")[0], self._clock.now_ns())
        self._waiting.append(request)
        self._send(text)
        return request

    def _send_target(self, text: str) -> None:
        self._targets.append(self._post(text))

    def _oldest_ns(self) -> int:
        return self._targets[0].sent_ns if self._targets else self._clock.now_ns()

    def _take_reply(self, reply: str) -> None:
        if not self._waiting:
            return  # of nobody's command
        request = self._waiting.popleft()
        request.reply = reply
        if self._targets and request is self._targets[0]:
            self._targets.popleft()
            self._judge_target(reply)


class MotionPort(TargetPort):
    """Targets of V3. Not every version answers them; of one that does not, TCP's receipts count."""

    def __init__(self, connection: socket.socket, clock: Clock) -> None:
        super().__init__(connection, clock)
        self._answers = False  # a target of this connection was answered
        self._waiting_ns: deque[int] = deque(maxlen=MAX_WAITING)
        self._receipt_ns = 0  # when everything was received

    def _send_target(self, text: str) -> None:
        self._send(text)
        self._waiting_ns.append(self._clock.now_ns())

    def _oldest_ns(self) -> int:
        if self._answers:
            return self._waiting_ns[0] if self._waiting_ns else self._clock.now_ns()
        unreceived = fcntl.ioctl(self._connection, termios.TIOCOUTQ, bytes(4))
        if not int.from_bytes(unreceived, "little"):
            self._receipt_ns = self._clock.now_ns()
        return self._receipt_ns

    def _take_reply(self, reply: str) -> None:
        if self._answers and self._waiting_ns:
            self._waiting_ns.popleft()
        elif not self._answers:  # those before were not, and will not be
            self._answers = True
            self._waiting_ns.clear()
        self._judge_target(reply)
