"""Record SIGINT and SIGTERM as a flag instead of raising."""

from __future__ import annotations

import signal
from types import FrameType
from typing import Self


class Interrupt:
    """Context in which the first SIGINT or SIGTERM only sets ``happened``.

    A second one has its previous effect: SIGINT raises KeyboardInterrupt. Main thread only.
    """

    def __init__(self) -> None:
        self.happened = False
        self._before = {number: signal.getsignal(number) for number in _NUMBERS}

    def __enter__(self) -> Self:
        for number in _NUMBERS:
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
