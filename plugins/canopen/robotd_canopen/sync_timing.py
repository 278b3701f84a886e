"""The even times of something periodic that a busy computer sees late, and sometimes in a burst."""

from __future__ import annotations

_EARLY = 2  # half a period before the next line: an event that is its own
_EASE = 256  # events in which the grid comes to events that are all late


class SyncTiming:
    """Lines one period apart, through the events that were least late.

    Events are late but never early. Counted by lines, the periods that pass are those of the clock:
    an event that is late for more than a period counts for the lines it has missed, too, and one
    that comes close behind it counts none.

    Attributes:
        time_ns: line of the last event; 0 before the first.
    """

    def __init__(self, period_ns: int, time_ns: int = 0) -> None:
        self.period_ns, self.time_ns = period_ns, time_ns

    def begin(self, now_ns: int = 0) -> None:
        """A line is at ``now_ns``; 0: at the next event."""
        self.time_ns = now_ns

    def note_event(self, now_ns: int) -> int:
        """An event at ``now_ns``: how many periods have passed since the one before, 1 at first."""
        elapsed_ns, period_ns = now_ns - self.time_ns, self.period_ns
        if not self.time_ns:
            self.time_ns = now_ns
            return 1
        if elapsed_ns >= period_ns:
            passed, late_ns = divmod(elapsed_ns, period_ns)
            self.time_ns = now_ns - late_ns + late_ns // _EASE
            return passed
        if elapsed_ns * _EARLY < period_ns:
            return 0
        self.time_ns = now_ns  # earlier than its line: the others were late
        return 1
