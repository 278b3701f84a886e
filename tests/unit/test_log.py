"""A log that cannot be written stops nothing."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import pytest
import structlog

from robotd.log import LogFormat, configure_logging, get_logger, lossy


@pytest.fixture(autouse=True)
def restored() -> Iterator[None]:
    before = structlog.get_config()
    yield
    structlog.configure(**before)


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
