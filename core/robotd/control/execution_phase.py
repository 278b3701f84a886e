"""Phases of an execution, and the state of the present one."""

from __future__ import annotations

from enum import Enum, auto

from robotd.clock import NANOSECONDS

SETTLED_PERIODS = 2  # consecutive periods within tolerance that count as arrived, or at rest


class Phase(Enum):
    """RUNNING → ARRIVING → end, or from either by STOPPING → RESTING → end."""

    RUNNING = auto()  # on the path, in time
    ARRIVING = auto()  # at the end of the path, until every joint is within its goal tolerance
    STOPPING = auto()  # slowing down along the path
    RESTING = auto()  # the command is at rest, until the joints are


class PhaseState:
    """Present phase, its age, and the number of consecutive settled periods in it."""

    def __init__(self, time_ns: int) -> None:
        self.phase = Phase.RUNNING
        self._since_ns = time_ns
        self._settled_periods = 0

    def enter(self, phase: Phase, time_ns: int) -> None:
        """Begin ``phase`` at ``time_ns``; the present one begins again."""
        self.phase, self._since_ns, self._settled_periods = phase, time_ns, 0

    def age_s(self, time_ns: int) -> float:
        """Return the time since the phase began."""
        return (time_ns - self._since_ns) / NANOSECONDS

    def settle(self, within_tolerance: bool) -> bool:
        """Count a period; return True after ``SETTLED_PERIODS`` in tolerance."""
        self._settled_periods = self._settled_periods + 1 if within_tolerance else 0
        return self._settled_periods >= SETTLED_PERIODS
