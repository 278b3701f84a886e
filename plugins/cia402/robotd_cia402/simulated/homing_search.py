"""Homing search by switches without an index pulse (CiA 402-2, methods 17 to 30)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

NEGATIVE_LIMIT, POSITIVE_LIMIT, HOME_SWITCH = 1, 2, 4  # bits of object 0x60FD


@dataclass(frozen=True)
class Method:
    """Search for a switch, then leave it in reverse: home is its edge.

    Attributes:
        switch: bit of object 0x60FD.
        direction: 1 or -1: of the search while the switch is open.
        turns: at the limit switch the search reverses; else it has failed.
    """

    switch: int
    direction: int
    turns: bool = False


METHODS = {
    17: Method(NEGATIVE_LIMIT, -1),
    18: Method(POSITIVE_LIMIT, 1),
    19: Method(HOME_SWITCH, 1),
    21: Method(HOME_SWITCH, -1),
    23: Method(HOME_SWITCH, 1, turns=True),
    27: Method(HOME_SWITCH, -1, turns=True),
}


class Phase(Enum):
    """SEARCHING (→ TURNED) → LEAVING → FOUND, or FAILED."""

    SEARCHING = auto()
    TURNED = auto()  # beyond the switch, back to it
    LEAVING = auto()  # on the switch, slowly off it
    FOUND = auto()
    FAILED = auto()


class Search:
    """One homing. ``fast`` and ``creep`` are speeds, rad/s (or m/s).

    Attributes:
        phase: present phase.
        velocity: command of the motor, signed in the direction of the drive.
    """

    def __init__(self, method: Method, fast: float, creep: float) -> None:
        self.phase = Phase.SEARCHING
        self.velocity = method.direction * fast
        self._method, self._fast, self._creep = method, fast, creep

    def step(self, inputs: int) -> None:
        """Advance by one period, with the present object 0x60FD."""
        method, closed = self._method, bool(inputs & self._method.switch)
        match self.phase:
            case Phase.SEARCHING | Phase.TURNED if closed:
                self._go(Phase.LEAVING, -method.direction * self._creep)
            case Phase.SEARCHING if inputs & self._limit(method.direction):
                if method.turns:
                    self._go(Phase.TURNED, -method.direction * self._fast)
                else:
                    self._go(Phase.FAILED, 0.0)
            case Phase.TURNED if inputs & self._limit(-method.direction):
                self._go(Phase.FAILED, 0.0)
            case Phase.LEAVING if not closed:
                self._go(Phase.FOUND, 0.0)
            case _:
                pass

    def _go(self, phase: Phase, velocity: float) -> None:
        self.phase, self.velocity = phase, velocity

    @staticmethod
    def _limit(direction: int) -> int:
        return POSITIVE_LIMIT if direction > 0 else NEGATIVE_LIMIT
