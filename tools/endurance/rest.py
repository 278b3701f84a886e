"""Coming to rest of an axis without setpoints, as observed from outside."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

STILL_S = 0.3  # without a change of position is standstill
POLL_S = 0.01
LONGEST_S = 10.0

Position = Callable[[], float | None]
"""The position now, in any unit; None when what has it is gone, and the motion with it."""


@dataclass(frozen=True)
class Rest:
    """From the first look to standstill.

    Attributes:
        seconds: until the position changed for the last time.
        distance: signed, from the first position to the last, in its unit.
    """

    seconds: float
    distance: float


def come_to_rest(position: Position) -> Rest:
    """Watch until it is at rest. Raises AssertionError when it goes on for ``LONGEST_S``."""
    began_s = changed_s = time.monotonic()
    first = before = position()
    while (now_s := time.monotonic()) - changed_s < STILL_S:
        seen = position()
        if seen is None:
            changed_s = now_s
            break
        if seen != before:
            before, changed_s = seen, now_s
        assert now_s - began_s < LONGEST_S, f"still moves after {LONGEST_S:g} s"
        time.sleep(POLL_S)
    return Rest(changed_s - began_s, (before or 0.0) - (first or 0.0))
