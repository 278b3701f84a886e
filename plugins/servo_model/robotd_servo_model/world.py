"""Discrete time of a simulation: a fixed tick, an agenda, and one lock.

There is no thread. Each reader and each command first calls ``advance``, which runs the ticks that
have become due. The result depends on the ticks alone, not on the times of the calls.
"""

from __future__ import annotations

import heapq
import threading
from collections.abc import Callable

from robotd.api import NANOSECONDS, Clock, get_logger
from robotd_servo_model.servo import Servo

FOREVER = 2**62

Action = Callable[[], None]


class ServoWorld:
    """Discrete-time simulation of a servo. Hold ``lock`` for every call; it is not re-entrant.

    Attributes:
        tick: fieldbus cycles run so far.
        slips: how often time was dropped because of a too long pause between calls.
        watch: called after each tick while set; True calls ``on_watch`` at that tick.
        lapse: when more time passes than to this tick, ``on_lapse`` is called before. Cheaper
            than an entry in the agenda for a time-out that is nearly always postponed.
    """

    def __init__(self, clock: Clock, servo: Servo, max_catch_up_s: float) -> None:
        self.lock = threading.Lock()
        self.servo = servo
        self.clock = clock
        self.tick = 0
        self.slips = 0
        self.watch: Callable[[], bool] | None = None
        self.on_watch: Action = lambda: None
        self.lapse = FOREVER
        self.on_lapse: Action = lambda: None
        self._tick_ns = round(servo.tick_s * NANOSECONDS)
        self._start_ns = clock.now_ns()
        self._catch_up = max(1, round(max_catch_up_s / servo.tick_s))
        self._agenda: list[tuple[int, int, Action]] = []
        self._entries = 0
        self._busy = [0] * servo.axes
        self._stirred = self._rest = 0

    @property
    def now_ns(self) -> int:
        """Monotonic time of the present tick."""
        return self._start_ns + self.tick * self._tick_ns

    def tick_of(self, time_ns: int) -> float:
        """Tick, with its fraction, at the monotonic time ``time_ns``."""
        return (time_ns - self._start_ns) / self._tick_ns

    def at(self, tick: int, action: Action) -> None:
        """Do ``action`` at the end of ``tick``, at the next one at the earliest."""
        self._entries += 1
        heapq.heappush(self._agenda, (max(tick, self.tick + 1), self._entries, action))

    def busy(self, axis: int, until: int) -> None:
        """The command of ``axis`` moves until the tick ``until`` (FOREVER: no end in sight)."""
        self._busy[axis] = until
        self._rest = min(FOREVER, max(*self._busy, self._stirred) + self.servo.settle_ticks)

    def stir(self) -> None:
        """Run the ticks until a disturbed axis has come to rest again."""
        self._stirred = self.tick
        self._rest = max(self._rest, self.tick + self.servo.settle_ticks)

    def moves(self, axis: int) -> bool:
        """Return True while the command of ``axis`` moves."""
        return self.tick < self._busy[axis]

    def advance(self) -> None:
        """Run the ticks up to the present.

        Axes at rest cost nothing. When something has been moving for longer than the bound
        on catching up, the rest of that time is dropped, as if the engine had been suspended.
        """
        due = (self.clock.now_ns() - self._start_ns) // self._tick_ns
        if due <= self.tick:
            return
        bound = self.tick + self._catch_up
        self._run(min(due, bound))
        if due <= bound:
            return
        if self.tick >= self._rest:
            self._run(due)
            return
        self.slips += 1
        self._start_ns += (due - bound) * self._tick_ns
        lost_s = (due - bound) * self.servo.tick_s
        get_logger("robotd.sim").warning("simulated time slipped", lost_s=lost_s)

    def _run(self, due: int) -> None:
        agenda = self._agenda
        while self.tick < due:
            if self.tick >= self.lapse:
                self.lapse = FOREVER
                self.on_lapse()
            stop = min(due, self.lapse, agenda[0][0]) if agenda else min(due, self.lapse)
            if self.tick >= self._rest:
                self.servo.rest()
                self.tick = stop
            else:
                self.tick, seen = self.servo.run(self.tick, min(stop, self._rest), self.watch)
                if seen:
                    self.on_watch()
            while agenda and agenda[0][0] <= self.tick:
                heapq.heappop(agenda)[2]()
