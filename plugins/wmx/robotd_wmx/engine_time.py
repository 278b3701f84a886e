"""Age of the values that the engine reports."""

from __future__ import annotations

LATEST_NS = 20_000_000  # a count that says more is not believed: the engine has lost cycles
RECOVERY = 0.01  # share of the passing time by which an estimate yields


class EngineTime:
    """Time of each engine cycle, estimated from its cycle counter.

    The moment of a read says little when the computer, and a counting engine with it, paused
    still in between. All cycles are equally long: the fastest read so far gives the time of cycle
    0, and so of every other. The estimate yields slowly, because the clocks of
    engine and computer differ, and an engine may lose cycles.
    """

    def __init__(self) -> None:
        self._start_ns = 0  # estimated time of cycle 0
        self._last_ns = 0

    def of(self, cycle: int, cycle_ns: int, now_ns: int) -> int:
        """Monotonic time of ``cycle``, at most ``now_ns`` and at least LATEST_NS before it."""
        start_ns = now_ns - cycle * cycle_ns
        given_way_ns = self._start_ns + int((now_ns - self._last_ns) * RECOVERY)
        self._last_ns = now_ns
        late = start_ns - given_way_ns > LATEST_NS
        self._start_ns = start_ns if late else min(start_ns, given_way_ns)
        return self._start_ns + cycle * cycle_ns
