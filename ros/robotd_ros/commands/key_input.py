"""Keys of a terminal as they are pressed, without waiting for a line."""

from __future__ import annotations

import os
import select
import termios
import tty
from typing import Self

MAX_BYTES = 1024


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
        """Return what was typed since the last call; never waits."""
        if self.lost or not select.select([self._descriptor], [], [], 0.0)[0]:
            return b""
        try:
            data = os.read(self._descriptor, MAX_BYTES)
        except OSError:
            data = b""
        self.lost = not data
        return data
