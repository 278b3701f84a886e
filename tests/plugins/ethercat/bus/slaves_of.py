"""Enumeration of slaves that bears a stall of the computer."""

from __future__ import annotations

import time

import pysoem

PATIENCE_S = 10.0


def find_slaves(master: pysoem.Master, count: int) -> None:
    """Enumerate until ``count`` slaves answer: the library waits 2 ms for a frame."""
    end = time.monotonic() + PATIENCE_S
    while (found := master.config_init()) != count:
        assert time.monotonic() < end, f"{found} slaves"
