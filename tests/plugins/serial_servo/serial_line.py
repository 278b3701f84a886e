"""Serial line of simulated servos on a pseudo-terminal, in real time.

Not entered, a line is in any time: ``take`` bytes, ``advance`` the servos, ``take_due`` replies.
Bytes take their time at the bit rate that the client has set. One thread receives requests, lets
the servos execute them, sends the replies when they would have arrived, and injects faults.
"""

from __future__ import annotations

import fcntl
import heapq
import os
import select
import shutil
import struct
import tempfile
import threading
import time
import tty
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Self

from tests.plugins.serial_servo.faults import Faults, collide, flip_a_bit
from tests.plugins.serial_servo.joints import Arm
from tests.plugins.serial_servo.simulated_servo import SimulatedServo

TICK_S = 0.01
LONGEST_WAIT_S = 0.1
"""For the wire: a servo keeps no more than the reply to the last request."""
TCGETS2 = 0x802C542A
"""Linux: terminal settings with the bit rate as a number, which ``termios`` does not return."""


@dataclass(slots=True)
class LineKnobs:
    """Settings of the line; each may change at any time."""

    echo: bool = False
    """The adapter returns what it sends."""
    adapter_latency_s: float = 0.0
    """Extra time from the end of a reply to its arrival; USB adapters have 0.001 to 0.016."""
    check_baud: bool = True
    """A servo receives only at its own bit rate. False: at any rate, timed as 1 Mbit/s."""
    collide: bool = False
    """A request that arrives while a reply is on the wire destroys both. Off: on a busy computer
    replies are late, and a client's second attempt would meet them."""
    after_missing: str = "skip"
    """Servos listed after a missing one in a sync read: "skip" answer at once, "stop" never do."""
    byte_gap_s: float = 0.02
    """An unfinished request is forgotten after this silence."""


class SerialLine(ABC):
    """Servos on one wire, and the adapter that makes it a serial port.

    A context manager: inside it ``port`` is the path of the serial port, and stays the same when
    the adapter is unplugged and plugged in again. All methods may be called from any thread. Fields
    of servos and joints may be set from any thread; hold ``lock`` to read several of one instant.
    """

    def __init__(self, servos: Mapping[int, SimulatedServo], *, seed: int = 0) -> None:
        self.servos = dict(servos)
        self.arm = Arm({key: servo.joint for key, servo in self.servos.items()})
        self.knobs = LineKnobs()
        self.faults = Faults()
        self.lock = threading.RLock()
        self.collisions = 0
        """Requests that were sent into a reply."""
        self.requests = 0
        """Requests with a right checksum."""
        self._random = Random(seed)
        self._received = bytearray()
        self._received_at = 0.0
        self._request_end = 0.0
        self._reply_time = (0.0, 0.0)
        self._due: list[tuple[float, int, bytes]] = []
        self._sent = 0
        self._master: int | None = None
        self._slave: int | None = None
        self._wanted = threading.Event()
        self._settled = threading.Condition()
        self._ending = False
        self._thread: threading.Thread | None = None
        self._folder = Path()

    # What a protocol adds

    @abstractmethod
    def next_frame(self, received: bytearray) -> bytes | None:
        """Remove what is not a frame and return the next request; None: incomplete."""

    @abstractmethod
    def execute(self, frame: bytes, end: float) -> None:
        """Execute a request that ended at ``end``; replies go to ``reply``."""

    @abstractmethod
    def with_id(self, frame: bytes, servo_id: int) -> bytes:
        """Return a reply as another servo would send it."""

    @abstractmethod
    def falsified(self, frame: bytes, random: Random) -> bytes:
        """Return a reply with one flipped bit in its data, and a right checksum."""

    # Use

    @property
    def port(self) -> str:
        """Path of the serial port; there is nothing while it is unplugged."""
        return str(self._folder / "port")

    def __getitem__(self, key: int) -> SimulatedServo:
        return self.servos[key]

    def __enter__(self) -> Self:
        self._folder = Path(tempfile.mkdtemp(prefix="servos-"))
        self.start(time.monotonic())
        self._open()
        self._wanted.set()
        self._thread = threading.Thread(target=self._run, name="simulated servos", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._ending = True
        if self._thread is not None:
            self._thread.join()
        self._close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def unplug(self) -> None:
        """Remove the adapter: the port disappears, an open one fails. Servos keep their power."""
        self._wanted.clear()
        self._wait_until_plugged(plugged=False)

    def plug_in(self) -> None:
        """Plug the adapter in again, under the same path."""
        self._wanted.set()
        self._wait_until_plugged(plugged=True)

    def power_off(self) -> None:
        """Take the supply from all servos; the adapter stays."""
        with self.lock:
            for servo in self.servos.values():
                servo.power_off()

    def power_on(self) -> None:
        with self.lock:
            for servo in self.servos.values():
                servo.power_on()

    # Adapter

    def _wait_until_plugged(self, *, plugged: bool) -> None:
        with self._settled:
            if not self._settled.wait_for(lambda: (self._master is not None) is plugged, 2):
                raise TimeoutError("the thread of the simulated servos does not run")

    def _open(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        fresh = self._folder / "new"
        fresh.symlink_to(os.ttyname(self._slave))
        fresh.rename(self._folder / "port")

    def _close(self) -> None:
        for descriptor in (self._slave, self._master):
            if descriptor is not None:
                os.close(descriptor)
        self._slave = self._master = None
        (self._folder / "port").unlink(missing_ok=True)
        self._received.clear()
        self._due.clear()

    @property
    def baud(self) -> int:
        """Bit rate that the client has set."""
        if self._slave is None or not self.knobs.check_baud:
            return 1_000_000
        settings = fcntl.ioctl(self._slave, TCGETS2, bytes(44))
        return struct.unpack_from("<I", settings, 40)[0]

    # Thread

    def _run(self) -> None:
        while not self._ending:
            if self._wanted.is_set() is not (self._master is not None):
                with self.lock, self._settled:
                    if self._master is None:
                        self._open()
                    else:
                        self._close()
                    self._settled.notify_all()
            self._wait()
            now = time.monotonic()
            with self.lock:
                self.advance(now)
                self._deliver(now)
                self._receive(now)

    def _wait(self) -> None:
        until = min(self._due[0][0] - time.monotonic(), TICK_S) if self._due else TICK_S
        if self._master is None:
            time.sleep(TICK_S)
        else:
            select.select([self._master], [], [], max(until, 0))

    def _deliver(self, now: float) -> None:
        data = self.take_due(now)
        if data and self._master is not None:
            # A client that does not read loses bytes, as it would in an adapter.
            with suppress(BlockingIOError):
                os.write(self._master, data)

    def _receive(self, now: float) -> None:
        if self._master is None:
            return
        try:
            data = os.read(self._master, 4096)
        except BlockingIOError:
            return
        self.take(data, now)

    # Time, in seconds of any clock

    def start(self, now: float) -> None:
        """Set the clocks of the servos."""
        for servo in self.servos.values():
            servo.start(now)

    def advance(self, now: float) -> None:
        """Let the servos live up to ``now``."""
        for servo in self.servos.values():
            servo.advance(now)

    @property
    def next_due(self) -> float | None:
        """When the next bytes get to the client; None: there are none."""
        return self._due[0][0] if self._due else None

    def take_due(self, now: float) -> bytes:
        """Return what gets to the client by ``now``, and forget it."""
        found = b""
        while self._due and self._due[0][0] <= now:
            found += heapq.heappop(self._due)[2]
        return found

    def take(self, data: bytes, now: float) -> None:
        """Receive bytes of the client at ``now``, and execute the requests that they complete."""
        if self._received and now - self._received_at > self.knobs.byte_gap_s:
            self._received.clear()
        self._received_at = now
        self._received += data
        baud = self.baud or 1
        if self.knobs.echo:
            self._send(data, now + len(data) * 10 / baud)
        while (frame := self.next_frame(self._received)) is not None:
            self._accept(frame, now, baud)

    def _accept(self, frame: bytes, now: float, baud: int) -> None:
        self.requests += 1
        start = max(now, self._request_end)
        self._request_end = end = start + len(frame) * 10 / baud
        begun, ended = self._reply_time
        if self.knobs.collide and begun < now < ended:
            self.collisions += 1
            self._due = [
                (due, number, flip_a_bit(data, self._random)) for due, number, data in self._due
            ]
            return
        self.execute(frame, end)

    # Replies

    def receives(self, servo: SimulatedServo, baud: int) -> bool:
        """Return whether a request reaches a servo that has the bit rate ``baud``."""
        if not servo.answering or (self.knobs.check_baud and baud != self.baud):
            return False
        return not self._happens("lose_request", servo)

    def reply(self, replies: Sequence[tuple[SimulatedServo, bytes]], start: float) -> float:
        """Send replies that begin at the same time; return when the wire is free again."""
        frames = []
        for servo, frame in replies:
            faulty, late = self._with_faults(servo, frame)
            if faulty:
                frames.append(faulty)
                start += late
        if not frames:
            return start
        data = collide(frames, self._random)
        if self._reply_time[1] - start > LONGEST_WAIT_S:
            return start
        start = max(start, self._reply_time[1])
        end = start + len(data) * 10 / (self.baud or 1)
        self._reply_time = (start, end)
        due = end + self.knobs.adapter_latency_s
        faults = [replies[0][0].faults, self.faults]
        for fault in faults:
            if len(data) > 1 and fault.happens("split", self._random):
                cut = self._random.randrange(1, len(data))
                self._send(data[:cut], due)
                data, due = data[cut:], due + fault.split_s
        self._send(data, due)
        return end

    def _send(self, data: bytes, due: float) -> None:
        self._sent += 1
        heapq.heappush(self._due, (due, self._sent, data))

    def _happens(self, name: str, servo: SimulatedServo) -> bool:
        return any(item.happens(name, self._random) for item in (servo.faults, self.faults))

    def _with_faults(self, servo: SimulatedServo, frame: bytes) -> tuple[bytes, float]:
        random = self._random
        if self._happens("drop", servo):
            return b"", 0
        late = sum(
            item.delay_s for item in (servo.faults, self.faults) if item.happens("delay", random)
        )
        if self._happens("wrong_id", servo):
            frame = self.with_id(frame, servo.id + random.randrange(1, 5))
        if self._happens("falsify", servo):
            frame = self.falsified(frame, random)
        if self._happens("wrong_checksum", servo):
            frame = frame[:-1] + bytes([frame[-1] ^ random.randrange(1, 256)])
        if self._happens("corrupt", servo):
            frame = flip_a_bit(frame, random)
        if self._happens("truncate", servo):
            frame = frame[: random.randrange(1, len(frame))]
        if self._happens("noise", servo):
            frame = random.randbytes(random.randrange(1, 5)) + frame
        return frame, late
