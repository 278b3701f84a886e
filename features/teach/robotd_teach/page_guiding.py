"""Hand guiding while a button of the page is held."""

from __future__ import annotations

import threading
from typing import Literal, Self

from robotd.api import NotReady
from robotd_page.held_motion import POLL_S, RELEASED, Heartbeat, HeldMotion, Hold, Motion
from robotd_teach.hand_guiding import HandGuiding

LEASE_S = 0.5  # without a heartbeat; a servo arm that is let go and caught in turn would shake


class Guide(Heartbeat):
    """Heartbeat of hand guiding.

    Attributes:
        group: joint group.
        held: somebody holds the arm, see ``HandGuiding.begin``.
    """

    type: Literal["guide"]
    group: str
    held: bool


class HeldGuiding(HeldMotion[Guide]):
    """Hand guiding by one client."""

    what = "Guiding"

    def open(self, beat: Guide, hold: Hold) -> Motion:
        return _Guided(self._robot.feature(HandGuiding), beat, hold)


class _Guided(Motion):
    """Joints that are guided until the button is released, or guiding ends by itself."""

    is_silent = False  # it never begins anew by itself

    def __init__(self, guiding: HandGuiding, beat: Guide, hold: Hold) -> None:
        self._guiding, self._beat, self._hold = guiding, beat, hold
        self._over = threading.Event()
        self._reason = ""

    @property
    def message(self) -> str:
        return self._reason

    def beat(self) -> None:
        self._guiding.keep()

    def end(self, reason: str) -> None:
        self._reason = self._reason or reason
        self._over.set()

    def wait(self) -> None:
        while not self._over.wait(POLL_S):
            if reason := self._guiding.reason:
                self.end(reason)

    def __enter__(self) -> Self:
        if self._hold.is_released:  # while the request waited
            raise NotReady(RELEASED)
        self._guiding.begin(self._beat.group, held=self._beat.held, lease_s=LEASE_S)
        return self

    def __exit__(self, *_: object) -> None:
        self._guiding.end()
