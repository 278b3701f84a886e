"""Setpoints to a drive that is silent: when it gets none, and how near the next one has to be."""

from __future__ import annotations

from collections import deque

from robotd_cia402.controlword import Control

_STEP_SHARE = 1.2  # of the way of a period at the velocity limit: the largest step after a silence
MAX_MISSED = 3  # unanswered frames after which nothing is known of the drive
_KEPT = 8  # latest setpoints; more than can be under way
_OPERATES = 1 << 3  # bit of the controlword, in "enable operation" alone


class Acknowledgement:
    """Withholds the setpoints of a drive that does not answer. Control loop.

    A drive that misses cyclic frames keeps the last setpoint that it got, and the next one that it
    gets must be near that. So none is sent that is further away than a period at the velocity limit
    leads, and none while nothing is known of the drive.

    Args:
        latency: setpoints under way while every frame is answered: those that are sent until the
            answer to the first of them is taken.
        settling: frames that a drive answers after a longer silence before it gets a setpoint.
            Setpoints from before the silence may arrive with its end: only then it shows them.

    Attributes:
        withholds: the drive gets no setpoint beyond the last one that was sent.
    """

    def __init__(self, latency: int, settling: int = 0) -> None:
        self.withholds = False
        self._latency, self._settling = latency, settling
        self._unsettled = 0  # frames still to be answered
        self._sent: deque[float] = deque(maxlen=_KEPT)  # one for each frame, the newest last
        self._range = 0.0, 0.0  # acknowledged last, and sent last, when withholding began

    def note(self, position: float) -> None:
        """Note the setpoint of the frame that is sent now."""
        self._sent.append(position)

    def forget(self) -> None:
        """Forget the setpoints: the drive is off, or begins anew."""
        self._sent.clear()
        self.withholds = False

    def check(
        self, missed: int, position: float, way: float, *, unreached: bool, blocked: bool = False
    ) -> bool:
        """Decide whether the next setpoint is withheld; return True if so.

        Args:
            missed: cyclic frames without an answer that should be there by now.
            position: the next setpoint, rad or m.
            way: of a period at the velocity limit, rad or m.
            unreached: for certain the missed frames have not reached the drive.
            blocked: no frame is sent now.
        """
        if missed >= MAX_MISSED or blocked:
            self._unsettled = self._settling
        if not missed and not blocked:
            self._settle()
        elif not self.withholds and self._sent:
            first, last = self._under_way(missed)
            too_far = abs(position - first) > _STEP_SHARE * way
            if missed >= MAX_MISSED or blocked or too_far:
                self.withholds, self._range = True, (first, first if unreached else last)
        return self.withholds

    def lose(self) -> None:
        """Withhold from now on, whatever is answered: the drive is lost."""
        if not self.withholds and self._sent:
            self.withholds, self._range = True, self._under_way(0)

    def command(self, reported: float | None) -> float:
        """Return the setpoint that the drive has executed last, of those that it may have got.

        While ``withholds``.

        Args:
            reported: position at rest, near the setpoint; None: not known, and the setpoint that
                was sent last is the most likely.
        """
        first, last = self._range
        if reported is None:
            return last
        return min(max(reported, min(first, last)), max(first, last))

    def _settle(self) -> None:
        """Note an answer."""
        if self.withholds and self._unsettled:
            self._unsettled -= 1
        else:
            self.withholds = False

    def _under_way(self, missed: int) -> tuple[float, float]:
        """Return the setpoint that was acknowledged last, and the one that was sent last."""
        return self._sent[-min(missed + self._latency, len(self._sent))], self._sent[-1]


def takes_away(word: int, before: int) -> bool:
    """Return True for a controlword that takes away energy or motion, and adds nothing.

    Compared with ``before``, that is one that sets no bit; the halt bit counts as inverted. One
    that enables operation as before has no effect, and is none.
    """
    halt = int(Control.HALT)
    sets = (word ^ halt) & ~(before ^ halt)
    return not sets and (word != before or not word & _OPERATES)
