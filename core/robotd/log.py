"""Logging with structlog: console lines, or one JSON object per line.

Logs go to standard error; standard output is for the output of commands. In a program that uses
robotd as a library and does not call ``configure_logging``, lines go to the loggers ``robotd.*`` of
``logging``: without a handler of the program, warnings and errors reach standard error.
"""

from __future__ import annotations

import json
import logging
import os
import re
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from enum import StrEnum
from typing import Any, NamedTuple, TextIO, cast

from robotd.optional_imports import missing

with missing("rich"):  # of the command line; structlog would format tracebacks with it
    import structlog
    from structlog.typing import EventDict, FilteringBoundLogger, Processor


class LogFormat(StrEnum):
    """Format of log lines."""

    CONSOLE = "console"
    JSON = "json"


FOREIGN_PERIOD_S = 10.0
OWN_LOGGERS = "robotd."
MAX_FOREIGN_CHARACTERS = 300
MAX_REASON_CHARACTERS = 1000
MAX_VALUE_CHARACTERS = 8000  # of a field of a line; errors of a file list up to 50 problems
# Control characters but tab and newline, and those that reorder or separate lines.
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")

LEVELS = ("debug", "info", "warning", "error")
_PRIORITIES = {"debug": 7, "info": 6, "warning": 4, "error": 3, "critical": 2}  # of syslog


class LogLine(NamedTuple):
    """One line of the log.

    Attributes:
        component: that logs.
        level: one of ``LEVELS``, or "critical".
        text: the event and its fields, one line.
        fields: values by name.
    """

    component: str
    level: str
    text: str
    fields: Mapping[str, Any]


Listener = Callable[[LogLine], None]

_listeners: list[Listener] = []


def configure_logging(
    level: str = "info", log_format: LogFormat = LogFormat.CONSOLE, stream: TextIO | None = None
) -> None:
    """Set level (one of ``LEVELS``), format and stream for the whole process.

    ``stream`` None is the current standard error. JSON lines to the journal of systemd begin with
    their priority, which the journal takes away.
    """
    stream = sys.stderr if stream is None else stream
    shared: list[Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.processors.StackInfoRenderer(),
        _escape,
        _pass_on,
    ]
    if log_format is LogFormat.JSON:
        tail: list[Processor] = [
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            _journal_line if is_journal(stream) else structlog.processors.JSONRenderer(),
        ]
    else:
        tail = [
            structlog.processors.TimeStamper(fmt="%H:%M:%S.%f", utc=False),
            structlog.dev.ConsoleRenderer(colors=stream.isatty(), pad_event_to=0),
        ]
    _take_foreign_logs()
    structlog.configure(
        processors=[*shared, *tail],
        wrapper_class=structlog.make_filtering_bound_logger(logging.getLevelName(level.upper())),
        logger_factory=structlog.PrintLoggerFactory(lossy(stream)),
        cache_logger_on_first_use=False,
    )


def is_journal(stream: TextIO) -> bool:
    """Return True where ``stream`` leads to the journal of systemd."""
    try:
        facts = os.fstat(stream.fileno())
    except (OSError, ValueError):
        return False
    return os.environ.get("JOURNAL_STREAM") == f"{facts.st_dev}:{facts.st_ino}"


def _journal_line(logger: Any, method: str, fields: EventDict) -> str:
    priority = _PRIORITIES.get(str(fields.get("level")), _PRIORITIES["error"])
    return f"<{priority}>{json.dumps(fields, default=repr)}"


def printable(text: str) -> str:
    """Return ``text`` as one line, with control characters escaped.

    What comes from other programs could otherwise forge lines, or command the terminal.
    """
    return escaped("; ".join(part.strip() for part in text.split("\n") if part.strip()))


def shortened(text: str, most: int = MAX_REASON_CHARACTERS) -> str:
    """Return ``text`` without its middle where it has more than ``most`` characters.

    What a client sends has no maximum length, and error texts repeat it.
    """
    if len(text) <= most:
        return text
    end = most // 4
    begin = most - end
    return f"{text[:begin]} ... ({len(text) - most} characters left out) ... {text[-end:]}"


def escaped(text: str) -> str:
    """Return ``text`` with control characters escaped; tabs and line ends stay."""
    return _CONTROL.sub(lambda found: ascii(found.group())[1:-1], text)


def _escape(logger: Any, method: str, fields: EventDict) -> EventDict:
    for key, value in fields.items():
        is_reason = isinstance(value, BaseException) and key != "exc_info"
        text = (str(value) or type(value).__name__) if is_reason else value
        if isinstance(text, str):
            fields[key] = printable(shortened(text, MAX_VALUE_CHARACTERS))
    return fields


class _ForeignLogs(logging.Handler):
    """Takes what libraries log: one line for each logger in ``FOREIGN_PERIOD_S``, no traceback.

    A client of a port can make a library log as often as it likes.
    """

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._next_s: dict[str, float] = {}
        self._hidden: Counter[str] = Counter()

    def emit(self, record: logging.LogRecord) -> None:
        if record.name.startswith(OWN_LOGGERS):
            return
        name, now_s = record.name, time.monotonic()
        if now_s < self._next_s.get(name, 0.0):
            self._hidden[name] += 1
            return
        self._next_s[name] = now_s + FOREIGN_PERIOD_S
        fields: dict[str, Any] = {}
        if record.exc_info and record.exc_info[1] is not None:
            fields["reason"] = repr(record.exc_info[1])[:MAX_FOREIGN_CHARACTERS]
        if hidden := self._hidden.pop(name, 0):
            fields["hidden"] = hidden
        # Never an error: an error makes the flight recorder save a file.
        get_logger(name).warning(record.getMessage()[:MAX_FOREIGN_CHARACTERS], **fields)


def _take_foreign_logs() -> None:
    root = logging.getLogger()
    for handler in [handler for handler in root.handlers if isinstance(handler, _ForeignLogs)]:
        root.removeHandler(handler)
    root.addHandler(_ForeignLogs())


def add_listener(listener: Listener) -> None:
    """Call ``listener`` with every line, in the thread that logs. Any thread.

    It must not block, raise or log. Lines below the level are not passed on.
    """
    _listeners.append(listener)


def remove_listener(listener: Listener) -> None:
    """Undo ``add_listener``. Any thread."""
    _listeners.remove(listener)


def lossy(stream: TextIO) -> TextIO:
    """Wrap ``stream`` to discard output that cannot be written.

    A full disk, a closed stream or a broken pipe must not stop a robot. Any thread.
    """
    return cast(TextIO, _Lossy(stream))


class _Lossy:
    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.isatty = stream.isatty

    def write(self, text: str) -> int:
        with suppress(OSError, ValueError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            self._stream.flush()


def _pass_on(logger: Any, method: str, fields: EventDict) -> EventDict:
    if _listeners:
        line = _line(fields)
        for listener in tuple(_listeners):
            listener(line)
    return fields


def _line(event_dict: EventDict) -> LogLine:
    fields = dict(event_dict)
    text = str(fields.pop("event", ""))
    level = str(fields.pop("level", "info"))
    component = str(fields.pop("component", ""))
    fields.pop("exc_info", None)
    details = " ".join(f"{key}={value}" for key, value in fields.items())
    return LogLine(component, level, f"{text} {details}".rstrip(), fields)


def get_logger(name: str) -> FilteringBoundLogger:
    """Return a logger whose lines carry ``component=name``. Any thread may use it."""
    return cast(FilteringBoundLogger, structlog.get_logger(component=name))


def _to_standard_logging(logger: Any, method: str, fields: EventDict) -> EventDict:
    exc_info = fields.get("exc_info")
    line = _line(fields)
    standard = logging.getLogger(f"{OWN_LOGGERS}{line.component}")
    standard.log(logging.getLevelName(line.level.upper()), "%s", line.text, exc_info=exc_info)
    raise structlog.DropEvent


if not structlog.is_configured():
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            structlog.processors.add_log_level,
            _escape,
            _pass_on,
            _to_standard_logging,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.DEBUG),
        cache_logger_on_first_use=False,
    )
