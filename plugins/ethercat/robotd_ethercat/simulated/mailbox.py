"""Mailbox of a slave: messages between SM0 and SM1, protocol errors, repeat requests."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable

from robotd_ethercat.simulated.slave_controller import SlaveController

HEADER = struct.Struct("<HHBB")  # length, station, channel, type and counter
ERROR, COE = 0x00, 0x03
UNSUPPORTED_PROTOCOL, INVALID_HEADER, SIZE_TOO_SHORT = 0x02, 0x05, 0x06
MAX_QUEUED = 16


class Mailbox:
    """Mailbox protocol over two SyncManagers.

    Attributes:
        silent: a fault, requests are taken and not answered.
    """

    def __init__(self, controller: SlaveController, on_coe: Callable[[bytes], None]) -> None:
        self._controller, self._on_coe = controller, on_coe
        self._queue: deque[tuple[int, bytes]] = deque()
        self._counter = 0
        self._last = b""
        self.silent = False

    @property
    def capacity(self) -> int:
        """Bytes of a message to the master, without the mailbox header."""
        return max(0, self._controller.sync_managers[1].length - HEADER.size)

    def reset(self) -> None:
        """Forget waiting messages, on the way to Init."""
        self._queue.clear()
        self._last, self._counter = b"", 0
        for manager in self._controller.sync_managers[:2]:
            manager.full = False

    def send(self, data: bytes, protocol: int = COE) -> None:
        """Queue a message to the master; dropped when too many wait."""
        if len(self._queue) < MAX_QUEUED:
            self._queue.append((protocol, data))

    def service(self) -> None:
        """Handle a message of the master, and put the next one to it."""
        controller = self._controller
        inbox, outbox = controller.sync_managers[:2]
        if controller.repeat_request:
            controller.repeat_request = False
            self._repeat()
        if inbox.active and inbox.full:
            message = bytes(controller.memory[inbox.start : inbox.end])
            inbox.full = False
            if not self.silent:
                self._receive(message)
        if self._queue and outbox.active and not outbox.full:
            self._put(*self._queue.popleft())

    def _receive(self, message: bytes) -> None:
        if len(message) < HEADER.size:
            return
        length, _, _, kind = HEADER.unpack_from(message)
        data = message[HEADER.size : HEADER.size + length]
        if len(data) < length:
            self._reject(INVALID_HEADER)
        elif kind & 0x0F != COE:
            self._reject(UNSUPPORTED_PROTOCOL)
        elif length < 2:
            self._reject(SIZE_TOO_SHORT)
        else:
            self._on_coe(data)

    def _reject(self, code: int) -> None:
        self.send(struct.pack("<HH", 1, code), ERROR)

    def _put(self, protocol: int, data: bytes) -> None:
        self._counter = self._counter % 7 + 1
        kind = protocol | self._counter << 4
        outbox = self._controller.sync_managers[1]
        self._last = (HEADER.pack(len(data), 0, 0, kind) + data)[: outbox.length]
        self._fill()

    def _fill(self) -> None:
        outbox = self._controller.sync_managers[1]
        self._controller.memory[outbox.start : outbox.end] = self._last.ljust(outbox.length, b"\0")
        outbox.full = True

    def _repeat(self) -> None:
        outbox = self._controller.sync_managers[1]
        if outbox.active and outbox.mailbox and self._last:
            self._fill()
        outbox.acknowledge_repeat()
