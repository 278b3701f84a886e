"""Hold to run by a stream: joints move while heartbeats of a button arrive."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Annotated, Generic, Literal, TypeVar

from pydantic import Field

from robotd.control.joint_stream import JointStream
from robotd.errors import NotReady, RobotdError
from robotd.events import sent_by
from robotd.robot import Robot
from robotd_page.control_commands import Message, Seen

HEARTBEAT_S = 0.02  # interval at which a page repeats the message of a button that is held
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
        remaining: signed distance to the target of a step, rad or m; None without a target.
    """

    hold: int
    is_wanted: bool
    is_silent: bool
    reason: str
    remaining: float | None = None


class StreamCommand:
    """Sends the setpoint of a heartbeat to a stream; called with it."""

    @property
    def remaining(self) -> float | None:
        """Signed distance to a target, rad or m; None without one."""
        return None

    @property
    def note(self) -> str:
        """Reason why the motion is slower than commanded; "": it is not."""
        return ""

    def __call__(self, stream: JointStream) -> None:
        """Send it. Raises NotReady."""
        raise NotImplementedError


Beat = TypeVar("Beat", bound=Heartbeat)


@dataclass(eq=False)
class _Hold:
    """Button that is held.

    Attributes:
        number: of the client.
        stream: of the joints; None until it is open.
        command: of each heartbeat.
        note: of the command, as the client knows it.
    """

    number: int
    stream: JointStream | None = None
    command: StreamCommand | None = None
    note: str = ""


class HeldStream(ABC, Generic[Beat]):
    """Motion by one client through a stream, a hold at a time.

    A hold begins with its first heartbeat and ends by ``release``, by silence for ``timeout_s``,
    or with the stream; later heartbeats of it are ignored, so that nothing moves again before
    the client presses anew. The stream of the control loop is the watchdog: it needs no thread of
    the server. ``beat``, ``release`` and ``close`` never block.

    Args:
        robot: of the joints.
        owner: of the joints while they move.
        workers: open the stream and wait for its end.
        ended: called by a worker with the end of each hold.
        timeout_s: as above, in time of the robot.
        noted: called by ``beat`` with hold and note, where the note of a command has changed.
    """

    def __init__(
        self,
        robot: Robot,
        owner: str,
        workers: Executor,
        ended: Callable[[JogEnd], None],
        timeout_s: float = TIMEOUT_S,
        noted: Callable[[int, str], None] = lambda hold, note: None,
    ) -> None:
        self.events = robot.events
        self._robot, self._owner, self._workers, self._ended = robot, owner, workers, ended
        self._timeout_s, self._noted = timeout_s, noted
        self._newest = 0
        self._hold: _Hold | None = None
        self._lock = threading.Lock()  # of the hold and its stream

    @abstractmethod
    def open_stream(self, beat: Beat) -> tuple[JointStream, StreamCommand]:
        """Open the stream of a hold. Worker. Raises RobotdError with the reason of a rejection."""

    def beat(self, beat: Beat) -> None:
        """Begin a hold, or keep it moving."""
        with self._lock:
            if beat.hold > self._newest:
                self._newest = beat.hold
                self._end(RELEASED)
                self._hold = _Hold(beat.hold)
                self._workers.submit(self._run, self._hold, beat)
                return
            hold = self._hold
            if hold is None or hold.number != beat.hold:
                return
            stream, command = hold.stream, hold.command
        if stream is None or command is None:
            return
        try:
            command(stream)
        except NotReady as error:
            stream.end(str(error))  # no effect where it has just ended; the worker says why
        if command.note != hold.note:
            hold.note = command.note
            self._noted(hold.number, hold.note)

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
        if hold is not None and hold.stream is not None:
            hold.stream.end(reason)

    def _run(self, hold: _Hold, beat: Beat) -> None:
        """Worker: open the stream, and give the joints back after its end."""
        is_silent, remaining = False, None
        with sent_by(self._owner):
            try:
                stream, command = self.open_stream(beat)
                with stream:
                    self._begin(hold, stream, command)
                    stream.wait()
                reason, is_silent = stream.message, stream.statistics.timeouts > 0
                remaining = command.remaining
            except RobotdError as error:
                reason = str(error)
        with self._lock:
            if self._hold is hold:
                self._hold = None
        is_wanted = reason in (RELEASED, REACHED)
        self._ended(JogEnd(hold.number, is_wanted, is_silent, reason, remaining))

    def _begin(self, hold: _Hold, stream: JointStream, command: StreamCommand) -> None:
        """Let the next heartbeat move the joints; a hold that has ended meanwhile never does."""
        with self._lock:
            if self._hold is hold:
                hold.stream, hold.command = stream, command
            else:
                stream.end(RELEASED)
