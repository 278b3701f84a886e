"""Looks after threads that call drivers: one that never returns must not look alive."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable

from robotd.clock import NANOSECONDS
from robotd.log import get_logger

log = get_logger("watchdog")

HANG_S = 1.0  # a busy computer may delay a period by tenths of a second: that is no hang
SIMULATED_HANG_S = 5.0  # nothing real moves: rather late than a run that depends on the computer
CHECKS = 4  # looks within the time that a piece of work may take
OURS = {"robotd", "rclpy", *sys.stdlib_module_names}  # packages that are no plugin's


def place_of(thread: threading.Thread | None) -> str:
    """Where ``thread`` is: the outermost call of a plugin or else of robotd; "" if in none."""
    frame = sys._current_frames().get(thread.ident or 0) if thread else None  # noqa: SLF001
    calls = []
    while frame is not None:
        module = str(frame.f_globals.get("__name__", "?"))
        calls.append((module, f"{module}: {frame.f_code.co_qualname}, line {frame.f_lineno}"))
        frame = frame.f_back
    foreign = [text for module, text in calls if module.partition(".")[0] not in OURS]
    own = [text for module, text in calls if module.partition(".")[0] == "robotd"]
    return foreign[-1] if foreign else own[0] if own else ""


class Watchdog:
    """A thread of its own, ``robotd-watchdog``, that the one it watches cannot hold up.

    Args:
        age_ns: for how long the present piece of work has been under way, in real time whatever
            the clock of the work is; 0: none is.
        place: where the work is now, for people.
        limit_s: the longest that it may take; it is granted ``HANG_S`` in any case.
        hang: called when it takes longer, with the reason; once for each piece.
        who, piece: what works, and what its pieces are called.
    """

    def __init__(
        self,
        age_ns: Callable[[], int],
        place: Callable[[], str],
        limit_s: float,
        hang: Callable[[str], None],
        *,
        who: str = "the cycle",
        piece: str = "a period",
    ) -> None:
        self._age_ns, self._place = age_ns, place
        self._who, self._piece = who, piece
        self._limit_s = max(limit_s, HANG_S)
        self._hang = hang
        self._hanging = False
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        self._thread = threading.Thread(target=self._run, name="robotd-watchdog", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread. It is not waited for longer than a look takes."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(self._limit_s)

    def look(self) -> None:
        """Judge the piece that is under way."""
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
        while not self._stop.wait(self._limit_s / CHECKS):
            try:
                self.look()
            except Exception:
                log.exception("what a hang calls for failed")
