"""Requests and replies over a port: time-outs, repetition, echo, registers that are read back."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Sequence
from contextlib import suppress
from typing import ClassVar, NamedTuple

from robotd.api import Clock
from robotd_serial_servo.serial_port import SerialPort
from robotd_serial_servo.servo_bus import BusError, NoReply, ServoBus

TRIES = 3  # of one request, before its servo counts as silent


class Reply(NamedTuple):
    """One reply: ``error`` is the byte of that name, whose meaning is the family's."""

    servo: int
    error: int
    data: bytes


class Parsed(NamedTuple):
    """Replies in a piece of the line, the bytes that may begin the next, and damaged frames."""

    replies: list[Reply]
    rest: bytes
    corrupt: int


class RequestBus(ServoBus):
    """A family whose servos answer requests for registers. One thread at a time.

    Args:
        reply_timeout_s: from the end of a request to its reply, besides the time on the wire.

    Attributes:
        overhead: bytes of a reply without data.
        ping_bytes: data in the reply to a ping.
        reply_delay_s: of the slowest servo that was identified.
    """

    overhead: ClassVar[int]
    ping_bytes: ClassVar[int] = 0

    def __init__(self, port: SerialPort, clock: Clock, reply_timeout_s: float) -> None:
        self.corrupt = 0
        self.reply_delay_s = 0.0
        self._port, self._clock, self._timeout_s = port, clock, reply_timeout_s
        self._knows_echo = False

    @abstractmethod
    def _parse(self, line: bytes, size: int) -> Parsed:
        """Find the replies with ``size`` bytes of data in ``line``."""

    @abstractmethod
    def _ping_frame(self, servo: int) -> bytes:
        """Return the request for a sign of life."""

    @abstractmethod
    def _read_frame(self, servo: int, address: int, size: int) -> bytes:
        """Return the request for registers."""

    @abstractmethod
    def _write_frame(self, servo: int, address: int, data: bytes) -> bytes:
        """Return the request that writes registers."""

    def _rejection(self, reply: Reply) -> str:
        """Return why a servo has not executed a request; "": it has, or does not say."""
        return ""

    def close(self) -> None:
        self._port.close()

    def ping(self, servo: int) -> bool:
        request = self._ping_frame(servo)
        if not self._knows_echo:
            self._detect_echo(request)
        for _ in range(TRIES):
            corrupt = self.corrupt
            replies = self._exchange(request, [servo], self.ping_bytes)
            if any(reply.servo == servo for reply in replies):
                return True
            if self.corrupt == corrupt:
                return False
        return True  # something answers, and what it says is damaged

    def _write(self, servo: int, address: int, data: bytes, compare: int = 0) -> None:
        """Write registers and read them back; ``compare``: so many bytes of them, 0: all."""
        request, found, rejection = self._write_frame(servo, address, data), b"", ""
        wanted = data[: compare or len(data)]
        for _ in range(TRIES):
            with suppress(NoReply):  # some servos are set to confirm no write
                for reply in self._exchange(request, [servo], 0):
                    rejection = self._rejection(reply)
            found = self._read(servo, address, len(wanted))
            if found == wanted:
                return
        what = f"servo {servo}: register {address} is {found.hex(' ')}"
        because = f": {rejection}" if rejection else ""
        raise BusError(f"{what} after {wanted.hex(' ')} was written{because}")

    def _read(self, servo: int, address: int, size: int) -> bytes:
        """Return registers of one servo. Raises NoReply after ``TRIES``, BusError: rejected."""
        request, corrupt = self._read_frame(servo, address, size), self.corrupt
        for _ in range(TRIES):
            for reply in self._exchange(request, [servo], size):
                if reply.servo == servo and len(reply.data) == size:
                    return reply.data
                if reply.servo == servo and (rejection := self._rejection(reply)):
                    raise BusError(f"servo {servo}: register {address} cannot be read: {rejection}")
        if self.corrupt > corrupt:
            what = f"servo {servo}: its replies are damaged"
            raise NoReply(f"{what}: two servos with this id, a loose cable or a second program")
        raise NoReply(f"servo {servo} does not answer: cable, supply, id or bit rate")

    def _exchange(self, request: bytes, servos: Sequence[int], size: int) -> list[Reply]:
        """Send a request and collect replies until all ``servos`` have answered, or too late."""
        port, missing, found = self._port, set(servos), list[Reply]()
        port.send(request)
        count = len(servos)
        wire_s = (len(request) + count * (size + self.overhead)) * port.byte_s
        deadline = time.monotonic() + wire_s + count * self.reply_delay_s + self._timeout_s
        line, seen = b"", False
        while missing:
            part = port.receive(deadline)
            if not part:
                port.expect_late_bytes()
                self.corrupt += seen and not found  # bytes that are not a reply
                break
            seen = True
            replies, line, corrupt = self._parse(line + part, size)
            self.corrupt += corrupt
            found += replies
            missing.difference_update(reply.servo for reply in replies)
        return found

    def _detect_echo(self, request: bytes) -> None:
        """Find out whether the adapter returns what is sent, by one ping."""
        port, line = self._port, b""
        port.send(request)
        deadline = time.monotonic() + self._timeout_s
        while len(line) < len(request) and (part := port.receive(deadline)):
            line += part
        if line:
            self._knows_echo, port.echoes = True, line.startswith(request)
        port.expect_late_bytes()
