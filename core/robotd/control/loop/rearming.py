"""Re-arming: who commanded on through a stop, a fault or a restart of robotd has to begin anew.

Otherwise the next command would move the robot as soon as the stop or fault ends, to a target that
has moved on meanwhile.
"""

from __future__ import annotations

import itertools
import math
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robotd.arrays import BoolArray
from robotd.clock import NANOSECONDS
from robotd.control.loop.setpoint_source import Completion, Outcome
from robotd.device.axes import Axes
from robotd.device.process_image import ProcessImage
from robotd.device.state import GUIDING, CommandMode
from robotd.errors import NotReady
from robotd.log import get_logger

log = get_logger("commands")

SILENCE_S = 0.5  # at least: the jitter of a client at 10 Hz must not pass for silence
MAX_KNOWN = 64  # sources that are looked up by name; beyond it silent ones are forgotten

MAX_PUBLISHERS = 16  # of a topic that are distinguished

Numbers = tuple[int, ...]  # of the newest interruptions that concern a source

# Of the topic being handled: sequence number of the last message before which others can have been
# missed, and ``listened_ns`` when it was received.
_complete_since: ContextVar[tuple[float, float]] = ContextVar(
    "complete_since", default=(1, -math.inf)
)


class Rearming:
    """Sources of commands of a robot, and the interruptions of its motion. Any thread.

    Attributes:
        listened_ns: time in which commands could arrive, in periods of the control loop: while the
            computer stalls nothing is received, and that is not a silence.
    """

    def __init__(self, axes: Axes, period_ns: int) -> None:
        self.interruptions = Interruptions(axes)
        self.listened_ns = self._settled_ns = 0
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
                self._known = {key: kept for key, kept in known if not kept.is_silent}
            found = self._known.setdefault(key, source)
        found.silence_s = source.silence_s
        return found

    def listen(self, image: ProcessImage) -> None:
        """Count a period, whatever the state. Control loop."""
        self.listened_ns += self._period_ns
        if self.interruptions.has_changed:
            self.interruptions.has_changed, self._settled_ns = False, self.listened_ns

    @property
    def settled_ns(self) -> int:
        """``listened_ns`` since which no state that rejects motion has begun or ended."""
        return self.listened_ns if self.interruptions.has_changed else self._settled_ns

    def unarmed(self) -> list[str]:
        """Return the text of each source that goes on commanding and is not armed."""
        if not self._waiting:
            return []
        with self._lock:
            self._waiting = {source: None for source in self._waiting if source.is_waiting}
            return [source.text for source in self._waiting]

    def note_waiting(self, source: CommandSource) -> None:
        """List ``source`` among the problems until it is armed or silent."""
        with self._lock:
            self._waiting[source] = None


class Reception:
    """Evidence that the sources of a topic were silent. One thread.

    A source that sent nothing was silent only if no message can have been missed. Messages
    can be missed before a publisher is discovered, which may be at any time after a restart of
    robotd, and on a busy computer. So silence counts from the last message that was dropped, or
    whose sequence number does not follow the last one of a known publisher. The exception is a
    number so low that its publisher was silent before, or had just begun.
    """

    def __init__(self, rearming: Rearming) -> None:
        self._rearming = rearming
        self._since: tuple[float, float] | None = None  # None: nothing was received
        self._numbers: deque[int] = deque(maxlen=MAX_PUBLISHERS)  # the last one of each publisher

    @contextmanager
    def message(self, sequence: int | None) -> Iterator[None]:
        """Admit the commands of a message in the block.

        ``sequence``: its sequence number, from 1 on for each publisher; None: unknown.
        """
        if sequence is None:
            if self._since is None:
                self._since = math.inf, self._rearming.listened_ns
        elif sequence - 1 in self._numbers:
            self._numbers.remove(sequence - 1)
            self._numbers.append(sequence)
        else:
            self._numbers.append(sequence)
            if sequence > 1:
                self._since = sequence, self._rearming.listened_ns
        token = _complete_since.set(self._since or (1, -math.inf))
        try:
            yield
        finally:
            _complete_since.reset(token)

    def drop(self) -> None:
        """Note that the message is not handled: its sources do not learn of it."""
        self._since = math.inf, self._rearming.listened_ns


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
    """A client that sends commands for some axes. Only those of an armed source move anything.

    It is armed by silence or by a command that asks for no motion, if motion is possible then,
    until motion of its axes is interrupted. A source in this process that has not commanded yet
    counts as silent; for that of a topic see ``Reception``. Any thread; nothing blocks.

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
        self._received_ns: int | None = None  # ``listened_ns`` at its last command, admitted or not
        self._is_found = False  # it was commanding when it was first received
        self._rejected = 0  # commands since it was armed
        self._cause = ""
        self._lock = threading.Lock()

    @property
    def numbers(self) -> Numbers:
        """Numbers of the newest interruptions that concern it."""
        return tuple(interruption.number for interruption in self._newest())

    @property
    def is_silent(self) -> bool:
        """True once the client has sent nothing for ``silence_s``."""
        received_ns, now_ns = self._received_ns, self._rearming.listened_ns
        return received_ns is None or now_ns - received_ns > self.silence_s * NANOSECONDS

    @property
    def is_waiting(self) -> bool:
        """True while the client keeps commanding without being armed."""
        return self._rejected > 0 and not self.is_silent

    @property
    def text(self) -> str:
        """Reason of its rejections, and what arms it."""
        reason = f"kept commanding while motion was rejected ({self._cause})"
        if self._is_found:
            reason = "was commanding before robotd received it"
        return (
            f"{self.name} {reason}: release it (send nothing for {self.silence_s:g} s), or send"
            f" {self._neutral}, once"
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
        now_ns, silence_ns = self._rearming.listened_ns, self.silence_s * NANOSECONDS
        number, since_ns = _complete_since.get()
        was_silent = now_ns - since_ns > silence_ns
        # The first messages get lost while a publisher is discovered. Without a silence since
        # motion was allowed, it would have sent more: one in each ``silence_s``, one on its way.
        was_silent |= since_ns - self._rearming.settled_ns > (number + 1) * silence_ns
        if self._received_ns is None:
            self._is_found = not was_silent
        else:
            was_silent &= now_ns - self._received_ns > silence_ns
        self._received_ns = now_ns
        present, follows_speed = self._rearming.interruptions.present, self._follows_speed
        if error := present(self.axes, self._modes, follows_speed=follows_speed):
            self._armed_at = None
            return error, False
        if self._armed_at == numbers or not (neutral or was_silent):
            return None, False
        if self._rejected:
            log.info("source is armed again", source=self.name, rejected=self._rejected)
        self._armed_at, self._rejected, self._is_found = numbers, 0, False
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


class Interruption(NamedTuple):
    """Beginning of a state in which motion is rejected.

    Attributes:
        number: unique, and larger than those before it.
    """

    number: int
    reason: str


class Interruptions:
    """Newest interruptions of motion of a robot, of all its axes and of each.

    Motion is rejected while it is stopped, paused or not allowed by a lifecycle manager, while the
    device is not ready, and for an axis with a fault, guided by hand, with its servo off or in
    another command mode. A motion that is ended by a stop or a fault counts as well (``add``).

    Attributes:
        has_changed: such a state may have begun or ended. Its reader clears it.
    """

    def __init__(self, axes: Axes) -> None:
        self._axes, self._connection = axes, axes.connection
        self._numbers = itertools.count(1)
        self._all = self._pause = Interruption(0, "")
        self._of_axis = [self._all] * len(axes)
        self._of_mode = [self._all] * len(axes)
        self._unable: BoolArray = np.zeros(len(axes), np.bool_)  # in the last image, like the modes
        self._modes = axes.image.mode.copy()
        self._states = self._seen = b""
        self._inactive = ""
        self.has_changed = True
        axes.stop_latch.on_change(self._on_stop)
        axes.speed.on_change(self._on_speed)
        axes.connection.on_ready(self._on_ready)

    def add(self, axes: Sequence[int], reason: str) -> None:
        """Note that motion of ``axes`` was ended by a stop or a fault. Any thread."""
        for axis in axes:
            self._of_axis[axis] = self._interruption(reason)

    def watch(self, completion: Completion, axes: Sequence[int]) -> None:
        """Note an end by a stop or a fault of a motion of ``axes``.

        Before the motion is submitted.
        """
        recorded = False

        def note() -> None:
            nonlocal recorded
            # A cancelled motion can end with a fault: both count, what was asked for and what came.
            ends = completion.requested, (completion.outcome, completion.message)
            for outcome, message in filter(None, ends):
                if outcome in (Outcome.STOPPED, Outcome.FAULT) and not recorded:
                    recorded = True
                    self.add(axes, message)

        completion.on_end = note

    def look(self, image: ProcessImage) -> None:
        """Record axes that have become unable to move. Control loop, once a period."""
        inactive, before = self._axes.stop_latch.inactive, self._inactive
        states = image.states.tobytes()
        if states == self._states and inactive == before:
            return  # everything below is derived from these
        self._states, self._inactive = states, inactive
        if inactive and not before:
            self._all = self._interruption(f"the robot was {inactive}")
        guided = image.operation == GUIDING
        seen = image.flags.tobytes() + image.mode.tobytes() + guided.tobytes()
        if inactive != before or seen != self._seen:
            self.has_changed = True
        if seen == self._seen:
            return
        self._seen, names = seen, self._axes.names
        unable: BoolArray = image.amp_alarm | image.offline | ~image.servo_on | guided
        for axis in np.flatnonzero(unable & ~self._unable).tolist():
            reason = image.fault(axis) or ("hand guiding" if guided[axis] else "servo off")
            self._of_axis[axis] = self._interruption(f"{names[axis]}: {reason}")
        for axis in np.flatnonzero(image.mode != self._modes).tolist():
            self._of_mode[axis] = self._interruption(f"{names[axis]}: another command mode")
        self._unable, self._modes = unable, image.mode.copy()

    def newest(
        self, axes: Sequence[int], *, in_mode: bool, follows_speed: bool
    ) -> list[Interruption]:
        """Return those that concern the commands of ``axes``, always as many. Any thread.

        Args:
            in_mode: they need the axes in a certain mode.
            follows_speed: their motion slows down in a pause and continues after it.
        """
        found = [self._all, *(self._of_axis[axis] for axis in axes)]
        if in_mode:
            found += [self._of_mode[axis] for axis in axes]
        return found if follows_speed else [*found, self._pause]

    def present(
        self, axes: Sequence[int], modes: Sequence[CommandMode], *, follows_speed: bool
    ) -> NotReady | None:
        """Return the error of a motion command now; None: no state rejects it. Any thread.

        Owners do not count. An axis has to be unable to move in the last whole image as well: the
        next one may just be written.

        Args:
            modes: that it needs; empty: any.
            follows_speed: see ``newest``.
        """
        if rejection := self._axes.stop_latch.rejection:
            return NotReady(rejection)
        if not self._connection.commandable:
            return NotReady(self._connection.rejection)
        if not follows_speed and (rejection := self._axes.speed.rejection):
            return NotReady(rejection)
        for axis, mode in zip(axes, modes or self._modes[list(axes)], strict=True):
            if self._unable[axis] or self._modes[axis] != mode:
                owner = self._axes.owner(axis)
                if error := self._axes.inability(axis, CommandMode(int(mode)), owner):
                    return error
        return None

    def _interruption(self, reason: str) -> Interruption:
        return Interruption(next(self._numbers), reason)

    def _on_stop(self, reason: str) -> None:
        self.has_changed = True
        if reason:
            self._all = self._interruption(f"stopped: {reason}")

    def _on_speed(self, scale: float) -> None:
        self.has_changed = True
        if not scale:
            self._pause = self._interruption(self._axes.speed.text)

    def _on_ready(self, ready: bool) -> None:
        self.has_changed = True
        if not ready:
            self._all = self._interruption("the device was not ready")
