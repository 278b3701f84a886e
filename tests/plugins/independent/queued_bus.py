"""CAN interfaces whose frames wait while the bus is blocked; else they are ``udp_multicast``."""

from __future__ import annotations

import socket
import threading
import time
from collections import deque
from typing import ClassVar

import can
from can.interfaces.udp_multicast import UdpMulticastBus

FRAME_BYTES = 832  # that one waiting frame costs in the kernel


class QueuedBus(UdpMulticastBus):
    """Frames wait from ``block`` to ``release``, and are then sent at once.

    Attributes:
        opened: the buses of this kind that were opened, newest last.
        waited: frames that were held back, also those that were discarded.
        released_s: ages of the frames that were sent late, s.
    """

    opened: ClassVar[list[QueuedBus]] = []

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)
        self._waiting: deque[tuple[float, can.Message]] = deque()
        self._blocked = False
        self._lock = threading.Lock()
        self.waited, self.released_s = 0, list[float]()
        QueuedBus.opened.append(self)

    @property
    def limit(self) -> float:
        return float("inf")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        with self._lock:
            if not self._blocked:
                super().send(msg, timeout)
            elif len(self._waiting) < self.limit:
                self._waiting.append((time.monotonic(), msg))
                self.waited += 1
            else:
                raise can.CanOperationError("Transmit buffer full")

    def block(self) -> None:
        with self._lock:
            self._blocked = True

    def release(self) -> None:
        with self._lock:
            now_s, self._blocked = time.monotonic(), False
            while self._waiting:
                sent_s, message = self._waiting.popleft()
                self.released_s.append(now_s - sent_s)
                super().send(message)

    def discard(self) -> None:
        with self._lock:
            self._waiting.clear()


class SocketCan(QueuedBus):
    """As SocketCAN: the send buffer limits what may wait; ``close`` takes none back."""

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    @property
    def limit(self) -> float:
        doubled = self.socket.getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF)
        return doubled / 2 / FRAME_BYTES  # a datagram socket is writable below the half

    def shutdown(self) -> None:
        self.socket.close()
        super().shutdown()


class Kvaser(QueuedBus):
    """As kvaser: discards what waits by a call of its driver."""

    def flush_tx_buffer(self) -> None:
        self.discard()


INTERFACES = {"socketcan": SocketCan, "kvaser": Kvaser}
"""Interface of python-can to the class that is in its place."""
