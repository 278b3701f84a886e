"""Hold to run: joints move while heartbeats of a button arrive."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from typing import Annotated, Generic, Literal, Self, TypeVar

from pydantic import Field

from robotd.api import NANOSECONDS, NotReady, RobotdError, get_logger
from robotd.api.features import sent_by
from robotd.api.robots import JointStream, Outcome, Robot, TrajectoryExecution
from robotd_page.control_commands import Message, Seen

log = get_logger("page")

HEARTBEAT_S = 0.02  # interval at which a page repeats the message of a button that is held
POLL_S = 0.01
TIMEOUT_S = 0.06  # age of the last heartbeat at which the joints slow to rest
REACHED = "reached"
RELEASED = "released"
CLOSED = "connection closed"


class Heartbeat(Message):
    """Message that a page repeats while a button is held.

    Attributes:
        hold: number that the client counts up with each press, whatever it moves.
        seen: as in ``Command``; that of the first heartbeat counts.
    """

    hold: Annotated[int, Field(ge=1)]
    seen: Seen | None = None


class Release(Message):
    """End of a hold.

    Attributes:
        hold: as in ``Heartbeat``.
        reason: as in the log.
    """

    type: Literal["release"]
    hold: int
    reason: Literal["released", "window lost focus", "tab hidden", "page left", "page stalled"]


@dataclass(frozen=True)
class JogEnd:
    """End of a hold.

    Attributes:
        hold: as in ``Heartbeat``.
        is_wanted: it was released, or reached its target.
        is_silent: its heartbeats came late, or none came.
        reason: text.
        remaining: signed distance to the target of a step, rad or m, or time to that of a move,
            s; None without a target.
        what: name of the motion.
    """

    hold: int
    is_wanted: bool
    is_silent: bool
    reason: str
    remaining: float | None = None
    what: str = "Jog"


class Motion(ABC):
    """Motion of a hold: a context that ends it, and gives the joints back."""

    @property
    def remaining(self) -> float | None:
        """Distance or time to the target, see ``JogEnd``; None without one."""
        return None

    @property
    def note(self) -> str:
        """Reason why it is slower than commanded; "": it is not."""
        return ""

    @property
    @abstractmethod
    def is_silent(self) -> bool:
        """True once it has ended for lack of a heartbeat."""

    @property
    @abstractmethod
    def message(self) -> str:
        """Reason of its end."""

    @abstractmethod
    def beat(self) -> None:
        """Go on, because a heartbeat came; never blocks. Raises NotReady."""

    @abstractmethod
    def end(self, reason: str) -> None:
        """Let the joints slow to rest; never blocks. No effect after the end."""

    @abstractmethod
    def wait(self) -> None:
        """Wait for the end, at rest."""

    @abstractmethod
    def __enter__(self) -> Self: ...

    @abstractmethod
    def __exit__(self, *_: object) -> None: ...


class StreamedMotion(Motion):
    """Motion by a stream of joints, whose own time-out ends it when the client is silent.

    Args:
        stream: open; ends when it is silent.
    """

    def __init__(self, stream: JointStream) -> None:
        self.stream = stream

    @property
    def is_silent(self) -> bool:
        return self.stream.statistics.timeouts > 0

    @property
    def message(self) -> str:
        return self.stream.message

    def end(self, reason: str) -> None:
        self.stream.end(reason)

    def wait(self) -> None:
        self.stream.wait()

    def __enter__(self) -> Self:
        self.stream.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self.stream.__exit__(*error)


@dataclass(eq=False)
class Hold:
    """Button that is held.

    Attributes:
        number: of the client.
        beat_ns: time of the newest heartbeat, on the robot's clock.
        motion: that it keeps going; None until it can move.
        note: of the motion, as the client knows it.
        is_released: it has ended.
    """

    number: int
    beat_ns: int
    motion: Motion | None = None
    note: str = ""
    is_released: bool = False


class PlannedMotion(Motion):
    """Planned motion, watched by the worker that waits for its end.

    Args:
        motion: a context that begins and ends it.
        hold: that keeps it going.
        is_late: returns whether no heartbeat has come for too long.
    """

    def __init__(
        self,
        motion: AbstractContextManager[TrajectoryExecution],
        hold: Hold,
        is_late: Callable[[], bool],
    ) -> None:
        self._motion, self._hold, self._is_late = motion, hold, is_late
        self._stack = ExitStack()
        self._is_silent = False

    @property
    def is_silent(self) -> bool:
        return self._is_silent

    @property
    def message(self) -> str:
        is_reached = self._execution.outcome is Outcome.SUCCEEDED
        return REACHED if is_reached else self._execution.message

    @property
    def remaining(self) -> float:
        """Time on its path, s."""
        return self._execution.trajectory.duration_s - self._execution.progress().time_s

    def beat(self) -> None:
        """Nothing to do: ``wait`` looks at the time of the newest heartbeat."""

    def end(self, reason: str) -> None:
        self._execution.completion.request(Outcome.CANCELED, reason)

    def wait(self) -> None:
        # Heartbeats that waited while the motion was planned are read during the first wait.
        while not self._execution.wait(POLL_S):
            if self._is_late() and not self._is_silent:
                self._is_silent = True
                self.end("heartbeats did not come")

    def __enter__(self) -> Self:
        if self._hold.is_released:  # while it was planned
            raise NotReady(RELEASED)
        self._execution: TrajectoryExecution = self._stack.enter_context(self._motion)
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()


Beat = TypeVar("Beat", bound=Heartbeat)


class HeldMotion(ABC, Generic[Beat]):
    """Motion by one client, a hold at a time.

    A hold begins with its first heartbeat and ends by ``release``, by silence for ``timeout_s``,
    or with its motion; later heartbeats of it are ignored, so that nothing moves again before
    the client presses anew. ``beat``, ``release`` and ``close`` never block.

    Args:
        owner: of the joints while they move.
        workers: open the motion and wait for its end.
        ended: called by a worker with the end of each hold.
        timeout_s: silence that ends a hold, in time of the robot.
        on_note: called by ``beat`` with hold and note, where the note of a motion has changed.
    """

    what = "Jog"  # of ``JogEnd``

    def __init__(
        self,
        robot: Robot,
        owner: str,
        workers: Executor,
        ended: Callable[[JogEnd], None],
        timeout_s: float = TIMEOUT_S,
        on_note: Callable[[int, str], None] = lambda hold, note: None,
    ) -> None:
        self.events = robot.events
        self._robot, self._owner, self._workers, self._ended = robot, owner, workers, ended
        self._timeout_s, self._on_note = timeout_s, on_note
        self._newest = 0
        self._hold: Hold | None = None
        self._lock = threading.Lock()  # of the hold and its motion

    @abstractmethod
    def open(self, beat: Beat, hold: Hold) -> Motion:
        """Return the motion of a hold. Worker. Raises RobotdError with the reason of a rejection.

        It moves nothing before it is entered.
        """

    def is_silent(self, hold: Hold) -> bool:
        """Return True where the last heartbeat of a hold came too long ago."""
        return self._robot.clock.now_ns() - hold.beat_ns > self._timeout_s * NANOSECONDS

    def beat(self, beat: Beat) -> None:
        """Begin a hold, or keep it moving."""
        now_ns = self._robot.clock.now_ns()
        with self._lock:
            if beat.hold > self._newest:
                self._newest = beat.hold
                self._end(RELEASED)
                self._hold = Hold(beat.hold, now_ns)
                self._workers.submit(self._run, self._hold, beat)
                return
            hold = self._hold
            if hold is None or hold.number != beat.hold:
                return
            hold.beat_ns, motion = now_ns, hold.motion
        if motion is None:
            return
        try:
            motion.beat()
        except NotReady as error:
            motion.end(str(error))  # no effect where it has just ended; the worker says why
        if motion.note != hold.note:
            hold.note = motion.note
            self._on_note(hold.number, hold.note)

    def release(self, number: int, reason: str) -> None:
        """End a hold; the joints slow to rest."""
        with self._lock:
            if self._hold is not None and self._hold.number == number:
                self._end(reason)

    def close(self) -> None:
        """End the hold because its client has gone."""
        with self._lock:
            self._end(CLOSED)

    def _end(self, reason: str) -> None:
        hold, self._hold = self._hold, None
        if hold is None:
            return
        hold.is_released = True
        if hold.motion is not None:
            hold.motion.end(reason)

    def _run(self, hold: Hold, beat: Beat) -> None:
        """Worker: move, and give the joints back after the end."""
        is_silent, remaining = False, None
        with sent_by(self._owner):
            try:
                motion = self.open(beat, hold)
                with motion:
                    self._begin(hold, motion)
                    motion.wait()
                reason, is_silent = motion.message, motion.is_silent
                remaining = motion.remaining
            except RobotdError as error:
                reason = str(error)
            except Exception as error:
                reason = f"robotd failed: {error}"
                log.exception("a hold of the page failed")
        with self._lock:
            if self._hold is hold:
                self._hold = None
        is_wanted = reason in (RELEASED, REACHED)
        self._ended(JogEnd(hold.number, is_wanted, is_silent, reason, remaining, self.what))

    def _begin(self, hold: Hold, motion: Motion) -> None:
        """Let heartbeats keep the motion going; that of a hold that has ended meanwhile ends."""
        with self._lock:
            if self._hold is hold:
                hold.motion = motion
            else:
                motion.end(RELEASED)
