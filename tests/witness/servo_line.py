"""Serial port in simulated time between a backend and the independent stand-ins of servos.

It stands in for pyserial, ``select`` and ``os.read`` below ``SerialPort``; the wire, its times and
its faults are those of ``tests/plugins/serial_servo``.
"""

from __future__ import annotations

import errno
import math
import os
import select
import time
from types import SimpleNamespace
from typing import Any

import serial
from tests.plugins.serial_servo.serial_line import SerialLine
from tests.witness.servo_clock import ServoClock

from robotd.clock import NANOSECONDS

URBS = 16  # writes that the driver of a USB adapter takes before one has got out
USB_S = 0.001


class ServoLine:
    """Adapter, and the wire behind it.

    Attributes:
        unplugged_s: the adapter is not there until then.
        blocked_s: it sends nothing until then; what it is given waits.
        sent_s: when the client wrote what the servos execute now.
    """

    def __init__(self, wire: SerialLine, clock: ServoClock) -> None:
        self.wire, self._clock = wire, clock
        self.unplugged_s = self.blocked_s = self.sent_s = 0.0
        self.ports: dict[int, Port] = {}
        wire.knobs.adapter_latency_s = USB_S
        wire.start(self.now_s)

    @property
    def now_s(self) -> float:
        return self._clock.now_ns() / NANOSECONDS

    @property
    def modules(self) -> dict[str, SimpleNamespace]:
        """Stand-ins for the modules of ``robotd_serial_servo.serial_port``, by name."""
        return {
            "serial": SimpleNamespace(**vars(serial) | {"Serial": self.open}),
            "select": SimpleNamespace(**vars(select) | {"select": self.select}),
            "os": SimpleNamespace(**vars(os) | {"read": self.read}),
            "time": self.time,
        }

    @property
    def time(self) -> SimpleNamespace:
        return SimpleNamespace(**vars(time) | {"monotonic": lambda: self.now_s})

    def open(self, path: str, *_: Any, write_timeout: float, **__: Any) -> Port:
        self.advance()
        if self.now_s < self.unplugged_s:
            raise serial.SerialException(errno.ENOENT, f"could not open port {path}")
        port = Port(self, write_timeout)
        self.ports[port.number] = port
        return port

    def unplug(self, seconds: float) -> None:
        """Take the adapter out, and plug it in again after a time; what waits in it is lost."""
        self.unplugged_s = self.now_s + seconds
        for port in self.ports.values():
            port.gone = True
            port.waiting.clear()

    def advance(self) -> None:
        """Let the servos, and the bytes on the way, get to the present."""
        self.wire.advance(self.now_s)
        for port in list(self.ports.values()):
            while port.waiting and self.now_s >= self.blocked_s:
                self.sent_s, data = port.waiting.pop(0)
                self.wire.take(data, self.now_s)
        arrived = self.wire.take_due(self.now_s)
        for port in self.ports.values():
            port.received += b"" if port.gone else arrived

    def select(
        self, readable: list[int], _: list[int], __: list[int], timeout_s: float
    ) -> tuple[list[int], list[int], list[int]]:
        """``select.select`` for a port to be readable."""
        port, clock = self.ports[readable[0]], self._clock
        end_ns = clock.now_ns() + round(timeout_s * NANOSECONDS)
        while True:
            self.advance()
            if port.gone or port.received:
                return readable, [], []
            now_ns = clock.now_ns()
            if now_ns >= end_ns:
                return [], [], []
            due_s = self.wire.next_due
            due_ns = end_ns if due_s is None else math.ceil(due_s * NANOSECONDS)
            clock.sleep_until_ns(min(end_ns, max(due_ns, now_ns + 1)))

    def read(self, number: int, limit: int) -> bytes:
        """``os.read``."""
        port = self.ports[number]
        if port.gone:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        part = bytes(port.received[:limit])
        del port.received[:limit]
        return part

    def sleep(self, seconds: float) -> None:
        self._clock.sleep_until_ns(self._clock.now_ns() + round(seconds * NANOSECONDS))


class Port:
    """Open port, as pyserial has it.

    Attributes:
        gone: its adapter was taken out.
        waiting: what the adapter has not sent yet, with the time of each write.
    """

    last_number = 1000

    def __init__(self, line: ServoLine, write_timeout_s: float) -> None:
        self._line, self._write_timeout_s = line, write_timeout_s
        Port.last_number += 1
        self.number, self.gone = Port.last_number, False
        self.received = bytearray()
        self.waiting: list[tuple[float, bytes]] = []

    def fileno(self) -> int:
        return self.number

    def write(self, data: bytes) -> int:
        line = self._line
        if self.gone:
            raise serial.SerialException(errno.EIO, "write failed")
        if len(self.waiting) >= URBS:
            line.sleep(self._write_timeout_s)
            line.advance()
            if len(self.waiting) >= URBS:
                raise serial.SerialTimeoutException("Write timeout")
        self.waiting.append((line.now_s, bytes(data)))
        line.advance()
        return len(data)

    def reset_output_buffer(self) -> None:
        self.waiting.clear()

    def close(self) -> None:
        self.waiting.clear()
        self._line.ports.pop(self.number, None)
