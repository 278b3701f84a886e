"""Clients of makers' SDKs, with time-outs that a busy computer keeps."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any


@contextmanager
def opened(sdk: ModuleType, port: str, baud: int = 1_000_000) -> Iterator[Any]:
    """Open ``port`` with an SDK's port handler; a missing reply costs a second."""
    sdk.port_handler.LATENCY_TIMER = 500  # ms, twice that is added to each time-out
    handler = sdk.PortHandler(port)
    handler.baudrate = baud
    assert handler.openPort()
    try:
        yield handler
    finally:
        handler.closePort()


@contextmanager
def impatient(sdk: ModuleType) -> Iterator[None]:
    """Wait for 60 ms only, where no reply is expected."""
    sdk.port_handler.LATENCY_TIMER = 30
    yield
    sdk.port_handler.LATENCY_TIMER = 500
