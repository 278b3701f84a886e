"""A serial port with one owner: whole requests out, bytes in until a deadline."""

from __future__ import annotations

import os
import select
import time
from pathlib import Path

import serial

from robotd.api import RobotdError

CHUNK = 4096
QUIET_S = 0.002  # without a byte: what a late reply still sends has ended
MAX_STALE_S = 0.05
WRITE_TIMEOUT_S = 0.1
DEFAULT_LATENCY_S = 0.001
USB_FRAME_S = 0.001  # full speed; a round trip takes two


class PortLost(RobotdError):
    """The port has gone: unplugged, taken by the system, or the far end of a pty was closed."""


class SerialPort:
    """An open port. One thread at a time.

    Args:
        path: device, such as ``/dev/ttyACM0``.
        baudrate: bit/s.

    Attributes:
        echoes: the adapter returns what was sent before the reply.
        byte_s: time of one byte on the wire.

    Raises OSError: it cannot be opened, or another program has it.
    """

    def __init__(self, path: str, baudrate: int) -> None:
        try:
            self._serial = serial.Serial(
                path, baudrate, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True
            )
        except ValueError as error:  # a rate that the driver does not know
            raise OSError(str(error)) from error
        self.path, self.echoes = path, False
        self.byte_s = 10.0 / baudrate
        self._fd = self._serial.fileno()
        self._late = False

    def close(self) -> None:
        """Close the port; called twice: no effect."""
        self._serial.close()

    def send(self, request: bytes) -> None:
        """Send a request, after what came too late for the one before has been dropped.

        Raises PortLost.
        """
        self._discard()
        try:
            self._serial.write(request)
        except serial.SerialTimeoutException:  # the adapter takes nothing: a lost request
            self._serial.reset_output_buffer()  # which must not be executed late
            self._late = True
        except (OSError, serial.SerialException) as error:
            raise PortLost(f"{self.path}: {error}") from error
        if self.echoes:
            missing, deadline = len(request), time.monotonic() + WRITE_TIMEOUT_S
            while missing and (part := self.receive(deadline, missing)):
                missing -= len(part)

    def receive(self, deadline: float, limit: int = CHUNK) -> bytes:
        """Return the bytes that are there, at least one; none after ``deadline``.

        Args:
            deadline: of ``time.monotonic``.
            limit: greatest number of bytes.

        Raises PortLost.
        """
        left_s = max(0.0, deadline - time.monotonic())
        try:
            if not select.select([self._fd], [], [], left_s)[0]:
                return b""
            part = os.read(self._fd, limit)
        except OSError as error:
            raise PortLost(f"{self.path}: {error.strerror or error}") from error
        if not part:
            raise PortLost(f"{self.path}: the device has gone")
        return part

    def expect_late_bytes(self) -> None:
        """Let the next request wait until the line is quiet: a reply has not come in time."""
        self._late = True

    def _discard(self) -> None:
        quiet_s = QUIET_S if self._late else 0.0
        self._late = False
        end = time.monotonic() + MAX_STALE_S
        while self.receive(time.monotonic() + quiet_s) and time.monotonic() < end:
            pass


def latency_timer_s(path: str) -> float | None:
    """Return the time for which an FTDI adapter holds bytes back; None: it has no such timer."""
    name = Path(path).resolve().name
    timer = Path("/sys/class/tty") / name / "device" / "latency_timer"
    try:
        return int(timer.read_text()) / 1000.0
    except (OSError, ValueError):
        return None
