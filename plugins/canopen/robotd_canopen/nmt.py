"""Network management (NMT): states and commands."""

from __future__ import annotations

from enum import IntEnum


class NmtState(IntEnum):
    """States as a heartbeat reports them (CiA 301, 7.2.8.3.2)."""

    BOOT_UP = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127
    UNKNOWN = 255  # never sent: no heartbeat has been received


class NmtCommand(IntEnum):
    """Commands of the NMT master (CiA 301, 7.2.8.3.1)."""

    START = 1
    STOP = 2
    PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


def heartbeat_state(data: bytes | bytearray) -> NmtState:
    """State in a heartbeat frame, toggle bit ignored. Raises ValueError for anything else."""
    if len(data) != 1:
        raise ValueError(f"a heartbeat has 1 byte, this one {len(data)}")
    return NmtState(data[0] & 0x7F)
