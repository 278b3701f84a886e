"""A log that cannot be written stops nothing."""

from __future__ import annotations

import io
import json
import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import pytest
import structlog

from robotd.log import (
    LogFormat,
    add_listener,
    configure_logging,
    get_logger,
    lossy,
    remove_listener,
)


@pytest.fixture(autouse=True)
def restored() -> Iterator[None]:
    before = structlog.get_config()
    handlers = logging.root.handlers[:]
    yield
    structlog.configure(**before)
    logging.root.handlers[:] = handlers


def full() -> TextIO:
    return Path("/dev/full").open("w", buffering=1)


def unread() -> TextIO:
    reader, writer = os.pipe()
    os.close(reader)
    return os.fdopen(writer, "w", buffering=1)


def closed() -> TextIO:
    stream = io.StringIO()
    stream.close()
    return stream


@pytest.mark.parametrize("broken", [full, unread])
@pytest.mark.parametrize("log_format", LogFormat)
def test_a_stream_that_takes_nothing_is_borne(broken: object, log_format: LogFormat) -> None:
    stream = broken()  # type: ignore[operator]
    configure_logging("info", log_format, stream)
    for _ in range(10_000):  # more than any buffer holds
        get_logger("test").info("lost")
    with pytest.raises(OSError, match=r"No space left|Broken pipe"):
        stream.close()


def test_a_closed_stream_is_borne() -> None:
    text = lossy(closed())
    assert text.write("lost") == 4
    text.flush()


def test_what_can_be_written_is_written() -> None:
    stream = io.StringIO()
    configure_logging("info", LogFormat.JSON, stream)
    get_logger("test").info("kept", axis=2)
    assert '"axis": 2' in stream.getvalue()


HOSTILE = "\x1b[2J\x1b]0;title\x07\r\u202e\x9b31m\n12:00:00 [info     ] ready"
HARMLESS = r"\x1b[2J\x1b]0;title\x07\r\u202e\x9b31m; 12:00:00 [info     ] ready"


@pytest.mark.parametrize("field", ["event", "reason"])
def test_no_client_can_forge_a_line_or_command_the_terminal(field: str) -> None:
    stream, lines = io.StringIO(), []  # type: ignore[var-annotated]
    configure_logging("info", LogFormat.CONSOLE, stream)
    add_listener(lines.append)
    try:
        get_logger("test").warning(**{"event": "rejected", field: HOSTILE})
    finally:
        remove_listener(lines.append)
    text = stream.getvalue()
    assert text.count("\n") == 1
    assert not any(character < " " or "\x7f" <= character < "\xa0" for character in text[:-1])
    assert HARMLESS in lines[0].text


def test_an_exception_as_a_value_is_its_text() -> None:
    stream = io.StringIO()
    configure_logging("info", LogFormat.CONSOLE, stream)
    get_logger("test").error("lost", reason=OSError("no space"), cause=TimeoutError())
    assert "reason='no space'" in stream.getvalue()
    assert "cause=TimeoutError" in stream.getvalue()


def test_a_library_cannot_flood_the_log() -> None:
    stream = io.StringIO()
    configure_logging("info", LogFormat.JSON, stream)
    for _ in range(1000):
        cause = ValueError(HOSTILE)
        logging.getLogger("aiohttp.server").error("Error handling request", exc_info=cause)
        logging.getLogger("other").debug("hidden")
    (line,) = map(json.loads, stream.getvalue().splitlines())
    assert (line["event"], line["component"]) == ("Error handling request", "aiohttp.server")
    assert line["level"] == "warning"  # an error saves a recording
    assert line["reason"].startswith("ValueError(")
    assert "exception" not in line


def test_a_library_logs_through_the_standard_library_and_is_quiet() -> None:
    program = """
import logging
from robotd.log import get_logger
log = get_logger("loop")
log.info("hidden")
log.warning("shown", axis=1)
logging.basicConfig(level=logging.INFO, format="%(name)s %(levelname)s %(message)s", force=True)
log.info("taken", axis=2)
try:
    1 / 0
except ZeroDivisionError:
    log.exception("failed")
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout == ""
    first, second, *rest = done.stderr.splitlines()
    assert (first, second) == ("shown axis=1", "robotd.loop INFO taken axis=2")
    assert rest[0] == "robotd.loop ERROR failed"
    assert rest[-1] == "ZeroDivisionError: division by zero"


def test_json_lines_to_the_journal_begin_with_their_priority(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (tmp_path / "journal").open("w") as stream:
        facts = os.fstat(stream.fileno())
        monkeypatch.setenv("JOURNAL_STREAM", f"{facts.st_dev}:{facts.st_ino}")
        configure_logging("info", LogFormat.JSON, stream)
        get_logger("axes").warning("alarm", axis=1)
        monkeypatch.setenv("JOURNAL_STREAM", "1:1")  # another stream
        configure_logging("info", LogFormat.JSON, stream)
        get_logger("axes").warning("alarm", axis=1)
    first, second = (tmp_path / "journal").read_text().splitlines()
    assert first.startswith('<4>{"component": "axes"')
    assert json.loads(second)["axis"] == 1
