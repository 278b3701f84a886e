"""Re-arming: a client that went on commanding while motion was rejected has to begin anew.

Otherwise its next command would move the robot as soon as a stop or a fault ends, to a target that
has moved on meanwhile.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

from robotd.clock import NANOSECONDS
from robotd.control.interruptions import Interruption, Interruptions
from robotd.control.problem import Problem, ProblemKind
from robotd.device.axes import Axes
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode
from robotd.errors import NotReady
from robotd.log import get_logger

log = get_logger("commands")

SILENCE_S = 0.5  # at least: the jitter of a client at 10 Hz must not pass for silence
MAX_KNOWN = 64  # sources that are looked up by name; beyond it silent ones are forgotten

Numbers = tuple[int, ...]  # of the newest interruptions that concern a source


class Rearming:
    """Sources of commands of a robot, and the interruptions of its motion. Any thread.

    Attributes:
        listened_ns: time in which commands could arrive, in periods of the control loop: while the
            computer stalls nobody is heard, and that is no silence.
    """

    def __init__(self, axes: Axes, period_ns: int) -> None:
        self.interruptions = Interruptions(axes)
        self.listened_ns = 0
        self._period_ns = period_ns
        self._known: dict[tuple[str, tuple[int, ...]], CommandSource] = {}
        self._waiting: dict[CommandSource, None] = {}  # in the order of their first interruptions
        self._lock = threading.Lock()

    def find(self, source: CommandSource) -> CommandSource:
        """Return the source of the same name and axes that was found before, or ``source``."""
        key = source.name, source.axes
        with self._lock:
            if key not in self._known and len(self._known) >= MAX_KNOWN:
                known = self._known.items()
                self._known = {key: each for key, each in known if not each.is_silent}
            found = self._known.setdefault(key, source)
        found.silence_s = source.silence_s
        return found

    def listen(self, image: ProcessImage) -> None:
        """Count a period, whatever the state. Control loop."""
        self.listened_ns += self._period_ns

    def problems(self) -> list[Problem]:
        """Return a problem for each source that goes on commanding and is not armed."""
        if not self._waiting:
            return []
        with self._lock:
            self._waiting = {each: None for each in self._waiting if each.is_waiting}
            return [Problem(ProblemKind.SOURCE, each.text) for each in self._waiting]

    def note_waiting(self, source: CommandSource) -> None:
        """List ``source`` among the problems until it is armed or silent."""
        with self._lock:
            self._waiting[source] = None


@dataclass(frozen=True)
class Admission:
    """Admission of one command.

    Attributes:
        numbers: of the interruptions before it.
        only_arms: its source was not armed; the command asks for no motion, and has armed it.
    """

    source: CommandSource
    numbers: Numbers
    only_arms: bool

    @property
    def holds(self) -> bool:
        """Motion was not interrupted since. Any thread."""
        return self.source.numbers == self.numbers


class CommandSource:
    """A client that sends commands for some axes; those for motion need an armed source.

    Silence arms it, or a command that asks for no motion, while no state rejects motion. It stays
    armed until motion of its axes is interrupted. Any thread; nothing blocks.

    Args:
        name: for people.
        axes: that its commands need.
        modes: of the axes, in which its commands can move them; empty: it sets the mode itself.
        timeout_s: age of its last command at which its motion ends.
        neutral: a command of it that asks for no motion, in words.
        follows_speed: its motion slows down in a pause and continues after it.

    Attributes:
        silence_s: time without a command that arms it.
    """

    def __init__(
        self,
        rearming: Rearming,
        name: str,
        axes: Sequence[int],
        modes: Sequence[CommandMode],
        *,
        timeout_s: float,
        neutral: str,
        follows_speed: bool = False,
    ) -> None:
        self.name, self.axes = name, tuple(axes)
        self.silence_s = max(timeout_s, SILENCE_S)
        self._rearming, self._modes, self._neutral = rearming, tuple(modes), neutral
        self._follows_speed = follows_speed
        self._armed_at: Numbers | None = None
        self._heard_ns: int | None = None  # ``listened_ns`` at its last command, admitted or not
        self._rejected = 0  # commands since it was armed
        self._cause = ""
        self._lock = threading.Lock()

    @property
    def numbers(self) -> Numbers:
        """Numbers of the newest interruptions that concern it."""
        return tuple(each.number for each in self._newest())

    @property
    def is_silent(self) -> bool:
        """It has sent nothing for ``silence_s``."""
        heard_ns, now_ns = self._heard_ns, self._rearming.listened_ns
        return heard_ns is None or now_ns - heard_ns > self.silence_s * NANOSECONDS

    @property
    def is_waiting(self) -> bool:
        """It goes on commanding, and is not armed."""
        return self._rejected > 0 and not self.is_silent

    @property
    def text(self) -> str:
        """Reason of its rejections, and what arms it."""
        return (
            f"{self.name} kept commanding while motion was rejected ({self._cause}): release it"
            f" (send nothing for {self.silence_s:g} s), or send {self._neutral}, once"
        )

    def begin(self) -> None:
        """Note that it is about to command: silence until now arms it."""
        with self._lock:
            self._arm(self.numbers, neutral=False)

    def admit(self, *, moves: bool) -> Admission:
        """Admit a command; ``moves``: it asks for motion.

        Raises NotReady for motion: a state rejects it, or the source is not armed.
        """
        with self._lock:
            numbers = self.numbers  # first: an interruption from now on counts
            error, only_arms = self._arm(numbers, neutral=not moves)
            if moves and error is not None:
                raise error
            if moves and self._armed_at != numbers:
                self._reject()
            return Admission(self, numbers, only_arms)

    def _arm(self, numbers: Numbers, *, neutral: bool) -> tuple[NotReady | None, bool]:
        """Arm it if that is allowed. Lock held.

        Returns the error of a state that rejects motion, and True where only ``neutral`` has
        armed it.
        """
        was_silent, self._heard_ns = self.is_silent, self._rearming.listened_ns
        present, follows_speed = self._rearming.interruptions.present, self._follows_speed
        if error := present(self.axes, self._modes, follows_speed=follows_speed):
            self._armed_at = None
            return error, False
        if self._armed_at == numbers or not (neutral or was_silent):
            return None, False
        if self._rejected:
            log.info("source is armed again", source=self.name, rejected=self._rejected)
        self._armed_at, self._rejected = numbers, 0
        return None, not was_silent

    def _reject(self) -> None:
        """Raise NotReady. Lock held."""
        self._cause = max(self._newest()).reason
        self._rejected += 1
        self._rearming.note_waiting(self)
        raise NotReady(self.text)

    def _newest(self) -> Sequence[Interruption]:
        return self._rearming.interruptions.newest(
            self.axes, in_mode=bool(self._modes), follows_speed=self._follows_speed
        )
