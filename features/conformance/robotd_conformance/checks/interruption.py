"""Stop signals during the checks: the first one interrupts a check, but no shutdown."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from robotd.api.commands import stop_signals


class InterruptOnce:
    """Raises KeyboardInterrupt at the first stop signal, and ignores further ones. Main thread."""

    def __init__(self) -> None:
        self._shutdowns = 0
        self._asked = self._pending = False

    def install(self) -> Callable[[], None]:
        """Handle the signals; return the function that undoes it."""

        def on_signal(number: int, frame: FrameType | None) -> None:
            for signum in before:
                signal.signal(signum, signal.SIG_IGN)
            self._asked = self._pending = True
            self._raise_pending()

        def restore() -> None:
            self._asked = self._pending = False
            for signum, handler in before.items():
                signal.signal(signum, handler)

        before = {signum: signal.signal(signum, on_signal) for signum in stop_signals()}
        return restore

    def between_checks(self) -> None:
        """Raise KeyboardInterrupt once more where a check has swallowed it.

        Python ignores what is raised while it runs a finalizer or a callback of native code.
        """
        if self._asked:
            raise KeyboardInterrupt

    @contextmanager
    def during_shutdown(self) -> Iterator[None]:
        """Context that is not interrupted; a signal that came in it counts at its end."""
        self._shutdowns += 1
        try:
            yield
        finally:
            self._shutdowns -= 1
            self._raise_pending()

    def _raise_pending(self) -> None:
        if self._pending and not self._shutdowns:
            self._pending = False
            raise KeyboardInterrupt


INTERRUPTION = InterruptOnce()
