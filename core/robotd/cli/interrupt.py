"""Record SIGINT and SIGTERM as a flag instead of raising."""

from __future__ import annotations

import signal
from types import FrameType
from typing import Self


class Interrupt:
    """Context in which the first SIGINT or SIGTERM only sets ``happened``.

    A second one has its previous effect: SIGINT raises KeyboardInterrupt. Main thread only.

    Args:
        hangup: SIGHUP too, which comes when the terminal is lost.
    """

    def __init__(self, *, hangup: bool = False) -> None:
        self.happened = False
        numbers = (*_NUMBERS, signal.SIGHUP) if hangup else _NUMBERS
        self._before = {number: signal.getsignal(number) for number in numbers}

    def __enter__(self) -> Self:
        for number in self._before:
            signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        self._restore()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.happened = True
        self._restore()

    def _restore(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)


_NUMBERS = (signal.SIGINT, signal.SIGTERM)
