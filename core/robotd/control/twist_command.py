"""Last commanded twist of a mobile base, its time-out, and the stop that rejects commands."""

from __future__ import annotations

from dataclasses import dataclass

from robotd.clock import NANOSECONDS
from robotd.control.rearming import Admission
from robotd.log import get_logger
from robotd.motion.planar import ZERO_TWIST, PlanarTwist

log = get_logger("base")


@dataclass(frozen=True)
class _Command:
    """Command with the time of its sending and its time-out, ns."""

    twist: PlanarTwist
    sent_ns: int
    timeout_ns: int
    admission: Admission


class TwistCommand:
    """Twist that holds until the next one, its time-out, or an interruption of motion.

    ``target`` is for the control loop, the rest for any thread.

    Attributes:
        stopped: no command holds until it is False again.
    """

    def __init__(self) -> None:
        self.stopped = False
        self._command: _Command | None = None
        self._late = False

    @property
    def ended(self) -> bool:
        """The last ``target`` was standstill because no command held."""
        return self._late or self.stopped

    def set(self, twist: PlanarTwist, time_ns: int, timeout_s: float, admission: Admission) -> None:
        """Replace the command by ``twist``, which was sent at ``time_ns``."""
        self._command = _Command(twist, time_ns, round(timeout_s * NANOSECONDS), admission)

    def moves(self, time_ns: int) -> bool:
        """Return True when a command other than standstill holds at ``time_ns``."""
        command = self._command
        if command is None or self.stopped or time_ns - command.sent_ns > command.timeout_ns:
            return False
        return command.twist != ZERO_TWIST and command.admission.holds

    def target(self, time_ns: int) -> PlanarTwist:
        """Return the twist to reach at ``time_ns``; a time-out in motion is logged."""
        command = self._command
        if self.stopped:
            return ZERO_TWIST
        if command is None or not command.admission.holds:
            self._late = True
            return ZERO_TWIST
        late = time_ns - command.sent_ns > command.timeout_ns
        if late and not self._late and command.twist != ZERO_TWIST:
            timeout_s = command.timeout_ns / NANOSECONDS
            log.warning("no command in time: the base slows to rest", timeout_s=timeout_s)
        self._late = late
        return ZERO_TWIST if late else command.twist
