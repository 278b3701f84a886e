"""SIGTERM as Ctrl-C, so that LeRobot's programs disconnect their devices."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_blocks = 0  # that are open: LeRobot disconnects the leader first, with the follower still on


@contextmanager
def sigterm_as_interrupt() -> Iterator[None]:
    """Let SIGTERM raise KeyboardInterrupt, unless the program handles it itself.

    Blocks may end in any order: the last one restores the signal. Of the main thread only, without
    effect in others.
    """
    global _blocks  # noqa: PLW0603 - a signal belongs to the process
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or not (_blocks or signal.getsignal(signal.SIGTERM) is signal.SIG_DFL):
        yield
        return
    _blocks += 1
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        _blocks -= 1
        if not _blocks:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
