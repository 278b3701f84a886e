"""Event log of a robot: commands with their senders, goals, results, faults, log lines.

The one place where the process notes what happened. The recorder, the metrics and every other
reader take the events from here; none of them has taps of its own.
"""

from __future__ import annotations

import functools
import inspect
import itertools
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, Concatenate, Generic, ParamSpec, Protocol, TypeVar

import numpy as np

from robotd.command_text import command_text
from robotd.errors import RobotdError

MAX_EVENTS = 8192
MAX_BYTES = 4 * 2**20
MAX_TEXT = 2000  # characters of an event's text
MAX_DATA_BYTES = 2**20  # of an event; points of a long trajectory are half of it
OVERHEAD_BYTES = 600  # of an event besides its text and data, measured by tracemalloc
OWN_PROCESS = "robotd"
BAD_OUTCOMES = frozenset({"path_tolerance", "goal_tolerance", "fault", "stopped"})

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")
Item = TypeVar("Item")

_sender: ContextVar[str] = ContextVar("sender", default=OWN_PROCESS)


class EventKind(StrEnum):
    """Kinds of events."""

    COMMAND = "command"  # of a client, accepted or rejected
    GOAL = "goal"  # a trajectory was accepted
    RESULT = "result"  # a trajectory ended
    STOP = "stop"  # all motion was stopped until a reset, or allowed again
    FAULT = "fault"  # of an axis, the controller or the device
    STATE = "state"  # a servo, a mode, an operation or the device's state changed
    LOG = "log"  # a line of the log
    MARK = "mark"  # a recording was requested


class Level(StrEnum):
    """Severity of an event, with the names of the log."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True)
class Event:
    """One entry of the log.

    Attributes:
        time_ns: monotonic time of the robot's clock.
        kind: see ``EventKind``.
        subject: joint, service, topic, or component that it is about.
        text: one line for people.
        level: see ``Level``.
        sender: client that caused it; ``OWN_PROCESS`` for robotd itself, "" where it is not known.
        data: numbers and names for programs; NumPy arrays for the points of a trajectory.
    """

    time_ns: int
    kind: EventKind
    subject: str
    text: str
    level: Level = Level.INFO
    sender: str = ""
    data: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_bad(self) -> bool:
        """True for a possible root cause: a fault, an error, a stop, a failed goal."""
        if self.kind in (EventKind.RESULT, EventKind.STOP):
            return self.data.get("outcome") in BAD_OUTCOMES
        is_error = self.kind is EventKind.LOG and self.level is Level.ERROR
        return is_error or self.kind is EventKind.FAULT


class BoundedLog(Generic[Item]):
    """Items of bounded number and memory; the oldest are dropped first. Any thread.

    Attributes:
        added: number of items since the start: the cursor after the newest.
        nbytes: estimate of the memory in use.
    """

    def __init__(self, max_items: int, max_bytes: int) -> None:
        self.added = 0
        self.nbytes = 0
        self._max_items, self._max_bytes = max_items, max_bytes
        self._items: deque[tuple[Item, int]] = deque()
        self._lock = threading.Lock()

    def append(self, item: Item, size: int) -> None:
        """Append ``item`` of ``size`` bytes."""
        with self._lock:
            self._items.append((item, size))
            self.nbytes += size
            self.added += 1
            while self.nbytes > self._max_bytes or len(self._items) > self._max_items:
                self.nbytes -= self._items.popleft()[1]

    def since(self, cursor: int) -> tuple[list[Item], int]:
        """Return the items added after ``cursor`` that are still held, and the next cursor."""
        with self._lock:
            number = min(self.added - cursor, len(self._items))
            newest = itertools.islice(reversed(self._items), number)
            return [item for item, _ in newest][::-1], self.added


class EventLog(BoundedLog[Event]):
    """Bounded log of events. Any thread.

    Args:
        now_ns: monotonic time of the robot's clock.

    Attributes:
        counts: number of events of each kind and outcome since the start, also of dropped ones.
    """

    def __init__(self, now_ns: Callable[[], int]) -> None:
        super().__init__(MAX_EVENTS, MAX_BYTES)
        self.counts: Counter[tuple[EventKind, str]] = Counter()
        self._now_ns = now_ns

    def add(
        self,
        kind: EventKind,
        subject: str,
        text: str,
        *,
        level: Level = Level.INFO,
        sender: str | None = None,
        data: Mapping[str, Any] | None = None,
        time_ns: int | None = None,
    ) -> Event:
        """Record an event and return it; never blocks for longer than another ``add``, 4 us.

        Args:
            kind, subject, text, level: see ``Event``.
            sender: None: the one of ``sent_by`` in this thread.
            data: not changed any more; "outcome" there is counted.
            time_ns: None: now.
        """
        time_ns = self._now_ns() if time_ns is None else time_ns
        sender = _sender.get() if sender is None else sender
        event = Event(time_ns, kind, subject, text, level, sender, data or {})
        self.note(event)
        return event

    def note(self, event: Event) -> None:
        """Record an event; text is cut at ``MAX_TEXT``, data left out beyond ``MAX_DATA_BYTES``.

        A client's request could otherwise drop all events before it.
        """
        if len(event.text) > MAX_TEXT:
            event = replace(event, text=event.text[:MAX_TEXT])
        size = _size(event.data)
        if size > MAX_DATA_BYTES:
            kept = {key: event.data[key] for key in ("outcome",) if key in event.data}
            event, size = replace(event, data=kept), _size(kept)
        self.count(event.kind, str(event.data.get("outcome", "")))
        self.append(event, OVERHEAD_BYTES + len(event.text) + size)

    def count(self, kind: EventKind, outcome: str) -> None:
        """Count an event; alone for those that come too often to be recorded."""
        self.counts[kind, outcome] += 1


class HasEvents(Protocol):
    """Facade whose commands are recorded."""

    events: EventLog


@contextmanager
def sent_by(sender: str) -> Iterator[None]:
    """Note ``sender`` with every event that this thread adds in the block."""
    token = _sender.set(sender)
    try:
        yield
    finally:
        _sender.reset(token)


Facade = TypeVar("Facade", bound=HasEvents)


def logged_command(
    command: Callable[Concatenate[Facade, Parameters], Result],
) -> Callable[Concatenate[Facade, Parameters], Result]:
    """Decorate a command of a facade: note its arguments, its sender and a rejection."""
    name, parameters = command.__name__, [*inspect.signature(command).parameters][1:]

    @functools.wraps(command)
    def call(self: Facade, /, *args: Parameters.args, **options: Parameters.kwargs) -> Result:
        arguments = {"call": name, "args": [*args], **({"options": options} if options else {})}
        try:
            result = command(self, *args, **options)
        except RobotdError as error:
            data = {**arguments, "outcome": "rejected"}
            text = f"{name} rejected: {error}"
            self.events.add(EventKind.COMMAND, name, text, level=Level.WARNING, data=data)
            raise
        data = {**arguments, "outcome": "accepted"}
        text = command_text(name, parameters, args, getattr(self, "names", ()))
        self.events.add(EventKind.COMMAND, name, text, data=data)
        return result

    return call


def _size(value: object) -> int:
    """Estimate the memory of data, bytes."""
    if isinstance(value, np.ndarray):
        return int(value.nbytes)
    if isinstance(value, Mapping):
        return 100 + sum(_size(part) for part in value.values())
    if isinstance(value, (list, tuple)):
        return 60 + sum(_size(part) for part in value)
    return 60 + len(value) if isinstance(value, (str, bytes)) else 40
