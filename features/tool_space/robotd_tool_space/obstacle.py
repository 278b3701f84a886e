"""Reasons why an arm cannot have its tool at a pose."""

from __future__ import annotations

from enum import Enum

from robotd.api import InvalidArgument


class Obstacle(Enum):
    """Kind of a reason."""

    OUT_OF_REACH = "out of reach"
    ORIENTATION = "orientation"
    LIMITS = "limits"
    SINGULAR = "singular"
    PATH = "path"  # positions before and behind it belong to different postures


class Unreachable(InvalidArgument):
    """A pose or line that the arm cannot reach; the text says why.

    Attributes:
        obstacle: kind of the reason.
        place: where on a line, 0 to 1; None: not on a line.
    """

    def __init__(self, obstacle: Obstacle, reason: str, place: float | None = None) -> None:
        super().__init__(reason if place is None else f"at {100.0 * place:.0f} % {reason}")
        self.obstacle, self.text, self.place = obstacle, reason, place
