"""Addresses for controllers, whose port is always the same."""

from __future__ import annotations

import itertools
import os
import socket

FCI_PORT = 1337
_numbers = itertools.count(2)


def free_address() -> str:
    """Return an address of this computer on which nothing listens at FCI's port."""
    for number in _numbers:
        address = f"127.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}.{number}"
        with socket.socket() as probe:
            if probe.connect_ex((address, FCI_PORT)):
                return address
    raise AssertionError("unreachable")
