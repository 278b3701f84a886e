"""Signals that ask a process to stop."""

from __future__ import annotations

import signal


def stop_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that ask this process to stop.

    SIGHUP (the terminal is lost) and SIGQUIT only where they are not ignored, as SIGHUP is under
    ``nohup``.
    """
    optional = (signal.SIGHUP, signal.SIGQUIT)
    wanted = (each for each in optional if signal.getsignal(each) is not signal.SIG_IGN)
    return (signal.SIGINT, signal.SIGTERM, *wanted)
