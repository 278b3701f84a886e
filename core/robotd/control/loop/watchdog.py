"""Watchdog: detects a thread stuck in a driver call."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable

from robotd.clock import NANOSECONDS
from robotd.log import get_logger

log = get_logger("watchdog")

HANG_TIMEOUT_S = 1.0  # a busy computer may delay a period by tenths of a second: that is not a hang
SIMULATED_HANG_TIMEOUT_S = 5.0  # nothing real moves: late, but whatever the computer does
CHECKS_PER_TIMEOUT = 4  # per time limit of a piece of work
OURS = {"robotd", "robotd_ros", "rclpy", *sys.stdlib_module_names}  # not packages of plugins


def place_of(thread: threading.Thread | None) -> str:
    """Return the outermost call of a plugin, else of robotd, in ``thread``; "" if none."""
    frame = sys._current_frames().get(thread.ident or 0) if thread else None  # noqa: SLF001
    calls = []
    while frame is not None:
        module = str(frame.f_globals.get("__name__", "?"))
        calls.append((module, f"{module}: {frame.f_code.co_qualname}, line {frame.f_lineno}"))
        frame = frame.f_back
    foreign = [text for module, text in calls if module.partition(".")[0] not in OURS]
    own = [text for module, text in calls if module.partition(".")[0] in ("robotd", "robotd_ros")]
    return foreign[-1] if foreign else own[0] if own else ""


class Watchdog:
    """Thread ``robotd-watchdog``, which reports when the watched thread exceeds its time limit.

    Args:
        age_ns: returns the age of the current piece of work, in real time whatever the clock of
            the work is; 0: none.
        place: returns the current call of the watched thread, for messages.
        limit_s: time limit of a piece of work; at least ``HANG_TIMEOUT_S`` is used.
        hang: called with the reason when the limit is exceeded; once for each piece.
        who, piece: names of the watched thread and of a piece of work, for messages.
    """

    def __init__(
        self,
        age_ns: Callable[[], int],
        place: Callable[[], str],
        limit_s: float,
        hang: Callable[[str], None],
        *,
        who: str = "the control loop",
        piece: str = "a period",
    ) -> None:
        self._age_ns, self._place = age_ns, place
        self._who, self._piece = who, piece
        self._limit_s = max(limit_s, HANG_TIMEOUT_S)
        self._hang = hang
        self._hanging = False
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start the thread."""
        self._thread = threading.Thread(target=self._run, name="robotd-watchdog", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread; wait for it no longer than ``limit_s``."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(self._limit_s)

    def check(self) -> None:
        """Check the age of the current piece of work."""
        age_s = self._age_ns() / NANOSECONDS
        if age_s <= self._limit_s:
            self._hanging = False
        elif not self._hanging:
            self._hanging = True
            place = self._place()
            what = f"{self._who} hangs"
            log.error(what, for_s=round(age_s, 3), place=place)
            self._hang(f"{what}: {self._piece} takes longer than {self._limit_s:g} s ({place})")

    def _run(self) -> None:
        while not self._stop.wait(self._limit_s / CHECKS_PER_TIMEOUT):
            try:
                self.check()
            except Exception:
                log.exception("hang handler failed")
