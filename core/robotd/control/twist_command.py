"""Last commanded twist of a mobile base, its time-out, and the stop that rejects commands."""

from __future__ import annotations

from robotd.clock import NANOSECONDS
from robotd.log import get_logger
from robotd.motion.planar import ZERO_TWIST, PlanarTwist

log = get_logger("base")


class TwistCommand:
    """Twist that holds until the next one, for its time-out at most.

    ``target`` is for the control loop, the rest for any thread.

    Args:
        timeout_s: pause after which a client is taken for a new one, see ``require_neutral``.

    Attributes:
        stopped: no command holds until it is False again.
    """

    def __init__(self, timeout_s: float) -> None:
        self.stopped = False
        self._timeout_ns = round(timeout_s * NANOSECONDS)
        self._command = (ZERO_TWIST, 0, 0)  # with the time of its sending and its time-out, ns
        self._late = False
        self._neutral, self._seen_ns = True, 0  # time of the last command, accepted or not

    @property
    def ended(self) -> bool:
        """The last ``target`` was standstill because of the time-out or ``stopped``."""
        return self._late or self.stopped

    def set(self, twist: PlanarTwist, time_ns: int, timeout_s: float) -> None:
        """Replace the command by ``twist``, which was sent at ``time_ns``."""
        self._command = (twist, time_ns, round(timeout_s * NANOSECONDS))

    def require_neutral(self) -> None:
        """Drop the command; accept none until a zero twist or a pause.

        The pause has to be as long as ``timeout_s``. After a stop, a client that still sends its
        last command must not move the base.
        """
        self._command, self._neutral = (ZERO_TWIST, 0, 0), self._seen_ns == 0

    def is_accepted(self, twist: PlanarTwist, time_ns: int) -> bool:
        """Return False for a command that continues one from before ``require_neutral``."""
        paused = time_ns - self._seen_ns > self._timeout_ns
        self._neutral |= paused or twist == ZERO_TWIST
        self._seen_ns = time_ns
        return self._neutral

    def moves(self, time_ns: int) -> bool:
        """Return True when a command other than standstill holds at ``time_ns``."""
        twist, sent_ns, timeout_ns = self._command
        in_time = time_ns - sent_ns <= timeout_ns
        return twist != ZERO_TWIST and in_time and not self.stopped

    def target(self, time_ns: int) -> PlanarTwist:
        """Return the twist to reach at ``time_ns``; a time-out in motion is logged."""
        twist, sent_ns, timeout_ns = self._command
        if self.stopped:
            return ZERO_TWIST
        late = time_ns - sent_ns > timeout_ns
        if late and not self._late and twist != ZERO_TWIST:
            timeout_s = timeout_ns / NANOSECONDS
            log.warning("no command in time: the base slows to rest", timeout_s=timeout_s)
        self._late = late
        return ZERO_TWIST if late else twist
