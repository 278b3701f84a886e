"""Nominal times of periodic events that are observed late or in bursts."""

from __future__ import annotations

_HOLD_PERIODS = 2  # without an event until a drive holds: on its way to the setpoint, and one more
_EARLY = 2  # half a period before the next nominal time it is an event of its own
_EASE = 256  # events over which the nominal times adapt to events that are all late
_CLEAR = (
    10  # a tenth of a period before and after its end sender and receiver may count differently
)


class SyncTiming:
    """Nominal times one period apart, fitted to the events that were least late.

    Events are late but never early. An event that is late by more than a period counts for the
    nominal times that it has missed, too, and one that comes close behind it counts none.

    Attributes:
        time_ns: nominal time of the last event; 0 before the first.
        after_rest: receivers that hold had come to rest before it.
    """

    def __init__(self, period_ns: int, time_ns: int = 0) -> None:
        self.period_ns, self.time_ns = period_ns, time_ns
        self.after_rest = False

    def begin(self, now_ns: int = 0) -> None:
        """Restart at ``now_ns``; 0: at the next event."""
        self.time_ns = now_ns

    def clear_ns(self, now_ns: int) -> int:
        """Return the earliest time from ``now_ns`` on at which missed events are counted alike.

        An event that comes when about two periods or more have passed counts for one more or one
        less, as early or late as the receiver sees it. A tenth of a period further on it is clear.
        """
        elapsed_ns, period_ns = now_ns - self.time_ns, self.period_ns
        margin_ns = period_ns // _CLEAR
        past_end_ns = (elapsed_ns + margin_ns) % period_ns  # 0: a margin before the end
        if (
            not self.time_ns
            or elapsed_ns < 2 * period_ns - margin_ns
            or past_end_ns >= 2 * margin_ns
        ):
            return now_ns
        return now_ns + 2 * margin_ns - past_end_ns

    def periods_at(self, now_ns: int) -> int:
        """Return for how many periods an event at ``now_ns`` would count, 1 at first.

        0: it comes close behind a late one.
        """
        elapsed_ns = now_ns - self.time_ns
        if not self.time_ns:
            return 1
        return elapsed_ns // self.period_ns or int(elapsed_ns * _EARLY >= self.period_ns)

    def note_event(self, now_ns: int) -> int:
        """Record an event; return ``periods_at`` its time."""
        periods = self.periods_at(now_ns)
        elapsed_ns = now_ns - self.time_ns
        if self.time_ns and elapsed_ns >= self.period_ns:
            late_ns = elapsed_ns - periods * self.period_ns
            self.time_ns = now_ns - late_ns + late_ns // _EASE
        elif periods:
            self.time_ns = now_ns  # the first, or earlier than nominal: the others were late
        self.after_rest = periods >= _HOLD_PERIODS
        return periods
