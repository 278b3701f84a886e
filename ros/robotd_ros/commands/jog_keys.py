"""Keys of a terminal as they are pressed, and the dead-man switch that jogs by them."""

from __future__ import annotations

import math
import os
import re
import select
import termios
import tty
from collections.abc import Iterator
from typing import Self

HOLD_S = 0.15  # terminals repeat a key that is held every 30 to 90 ms
SPEEDS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # rad/s or m/s

_KEYS = re.compile(rb"\x1b[\[O][0-9;]*[A-Za-z~]|.", re.DOTALL)
_DIRECTIONS = {b"\x1b[C": 1, b"\x1bOC": 1, b"l": 1, b"\x1b[D": -1, b"\x1bOD": -1, b"h": -1}
_QUIT = (b"q", b"Q", b"\x04")  # the last is Ctrl-D
_UNFINISHED = re.compile(rb"\x1b[\[O]?[0-9;]*\Z")
MAX_BYTES = 1024


class JogKeys:
    """Joint, speed and direction from the keys of a terminal.

    A terminal has no event for a release. A direction key moves for ``HOLD_S``; its repetitions
    prolong that. Every other key stops.

    Args:
        joints: number of joints to choose from.
        speed: at the beginning, rad/s or m/s.

    Attributes:
        joint: the chosen one, from 0.
        speed: rad/s or m/s.
        ended: a key asked for the end.
    """

    def __init__(self, joints: int, speed: float) -> None:
        self.joint, self.speed, self.ended = 0, speed, False
        self._joints = joints
        self._direction, self._until_s = 0, -math.inf
        self._seen_s = -math.inf
        self._tail = b""

    def feed(self, data: bytes, now_s: float) -> None:
        """Take the keys typed since the last call, all the time, also none.

        After a pause of the program, what was typed may be old, and moves nothing.
        """
        fresh = now_s - self._seen_s <= HOLD_S
        self._seen_s = now_s
        for key in self._keys(data):
            direction = _DIRECTIONS.get(key, 0) if fresh else 0
            self._direction, self._until_s = direction, now_s + HOLD_S
            self._choose(key)

    def velocity(self, now_s: float) -> float:
        """Return the velocity of the chosen joint, rad/s or m/s; 0 after the last repetition."""
        return self._direction * self.speed if now_s < self._until_s else 0.0

    def _choose(self, key: bytes) -> None:
        if key in _QUIT:
            self.ended = True
        elif key.isdigit() and 0 < int(key) <= self._joints:
            self.joint = int(key) - 1
        elif key in (b"+", b"="):
            self.speed = next((speed for speed in SPEEDS if speed > self.speed), self.speed)
        elif key == b"-":
            self.speed = next(
                (speed for speed in reversed(SPEEDS) if speed < self.speed), self.speed
            )

    def _keys(self, data: bytes) -> Iterator[bytes]:
        """Yield one item per key; an escape sequence may come in two pieces."""
        data = self._tail + data
        unfinished = _UNFINISHED.search(data)
        end = unfinished.start() if unfinished and unfinished[0] != self._tail else len(data)
        self._tail = data[end:]
        yield from _KEYS.findall(data[:end])


class KeyInput:
    """Terminal without echo and line editing: ``with KeyInput(0) as keys:``. Ctrl-C stays a signal.

    Attributes:
        lost: the terminal is gone.
    """

    def __init__(self, descriptor: int) -> None:
        self.lost = False
        self._descriptor = descriptor

    def __enter__(self) -> Self:
        self._before = termios.tcgetattr(self._descriptor)
        tty.setcbreak(self._descriptor)
        return self

    def __exit__(self, *_: object) -> None:
        try:
            termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)
        except termios.error:
            self.lost = True

    def read(self) -> bytes:
        """Return the keys typed since the last call; never waits."""
        if self.lost or not select.select([self._descriptor], [], [], 0.0)[0]:
            return b""
        try:
            data = os.read(self._descriptor, MAX_BYTES)
        except OSError:
            data = b""
        self.lost = not data
        return data
