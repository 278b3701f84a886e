"""Signals that ask a process to stop."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Self


def stop_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that ask this process to stop.

    SIGHUP (the terminal is lost) and SIGQUIT only where they are not ignored, as SIGHUP is under
    ``nohup``.
    """
    optional = (signal.SIGHUP, signal.SIGQUIT)
    wanted = (signum for signum in optional if signal.getsignal(signum) is not signal.SIG_IGN)
    return (signal.SIGINT, signal.SIGTERM, *wanted)


@contextmanager
def ended_by_interrupt() -> Iterator[None]:
    """Let Ctrl-C end the process at once, where it would raise KeyboardInterrupt.

    For imports, and while a robot is prepared: code of others swallows a KeyboardInterrupt, or
    makes another error of it, and the robot would start after it. Other handlers stay.
    """
    is_main = threading.current_thread() is threading.main_thread()
    raises = is_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if raises:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        if raises and signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
            signal.signal(signal.SIGINT, signal.default_int_handler)


class Interrupt:
    """Context in which the first stop signal only sets ``happened``.

    A second one has its previous effect: SIGINT raises KeyboardInterrupt. SIGHUP never does: it
    comes when the terminal is lost, often twice, from the kernel and from the shell. Main thread
    only.
    """

    def __init__(self) -> None:
        self.happened = False
        self._before: dict[int, Any] = {
            signum: signal.getsignal(signum) for signum in stop_signals()
        }

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
