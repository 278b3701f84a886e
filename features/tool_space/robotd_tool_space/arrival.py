"""Arrival of a request for motion of the tool, which takes a while to plan."""

from __future__ import annotations

from typing import NamedTuple

from robotd.api import NotReady
from robotd.api.robots import Interruption


class Arrival(NamedTuple):
    """State of a tool when a request for motion arrived.

    Attributes:
        ticket: of ``JointMotion.ticket``.
        interruptions: of motion, before it.
        choices: number of tools and work frames that were chosen before it.
    """

    ticket: int
    interruptions: list[Interruption]
    choices: int

    def require_current(self, now: Arrival) -> None:
        """Raise NotReady for a request that must not begin any more."""
        if now.interruptions != self.interruptions:
            raise NotReady("motion was stopped before this one began")
        if now.choices != self.choices:
            raise NotReady("another tool or work frame was chosen before the motion began")
