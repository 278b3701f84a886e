"""Record a signal that asks the process to stop as a flag instead of raising."""

from __future__ import annotations

import signal
from types import FrameType
from typing import Any, Self

from robotd.stop_signals import stop_signals


class Interrupt:
    """Context in which the first stop signal only sets ``happened``.

    A second one has its previous effect: SIGINT raises KeyboardInterrupt. SIGHUP never does: it
    comes when the terminal is lost, often twice, from the kernel and from the shell. Main thread
    only.
    """

    def __init__(self) -> None:
        self.happened = False
        self._before: dict[int, Any] = {each: signal.getsignal(each) for each in stop_signals()}

    def __enter__(self) -> Self:
        for number in self._before:
            signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.happened = True
        if number == signal.SIGHUP:
            return
        for other, handler in self._before.items():
            if other != signal.SIGHUP:
                signal.signal(other, handler)
