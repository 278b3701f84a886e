"""Record SIGINT and SIGTERM as a flag instead of raising."""

from __future__ import annotations

import signal
from collections.abc import Iterable
from types import FrameType
from typing import Any, Self


class Interrupt:
    """Context in which the first SIGINT or SIGTERM only sets ``happened``.

    A second one has its previous effect: SIGINT raises KeyboardInterrupt. Main thread only.

    Args:
        hangup: SIGHUP too, which comes when the terminal is lost, often twice: from the kernel and
            from the shell. The second one has no effect. It stays ignored under ``nohup``.
    """

    def __init__(self, *, hangup: bool = False) -> None:
        self.happened = False
        hangup = hangup and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN
        numbers = (*_NUMBERS, signal.SIGHUP) if hangup else _NUMBERS
        self._before: dict[int, Any] = {number: signal.getsignal(number) for number in numbers}

    def __enter__(self) -> Self:
        for number in self._before:
            signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        self._restore(self._before)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.happened = True
        self._restore(_NUMBERS)

    def _restore(self, numbers: Iterable[int]) -> None:
        for number in numbers:
            signal.signal(number, self._before[number])


_NUMBERS = (signal.SIGINT, signal.SIGTERM)
