"""SDO abort codes of the simulated slaves (CiA 301, table 22; ETG.1000.6)."""

from __future__ import annotations

from enum import IntEnum


class AbortCode(IntEnum):
    """Reasons for which an SDO transfer is aborted."""

    TOGGLE = 0x05030000
    UNKNOWN_COMMAND = 0x05040001
    UNSUPPORTED_ACCESS = 0x06010000
    WRITE_ONLY = 0x06010001
    READ_ONLY = 0x06010002
    COUNT_NOT_ZERO = 0x06010003
    NO_OBJECT = 0x06020000
    NOT_MAPPABLE = 0x06040041
    PDO_LENGTH = 0x06040042
    LENGTH = 0x06070010
    TOO_LONG = 0x06070012
    TOO_SHORT = 0x06070013
    NO_SUBINDEX = 0x06090011
    GENERAL = 0x08000000
    STATE = 0x08000022


class SdoAbort(Exception):
    """Abort of a transfer with ``code``."""

    def __init__(self, code: int) -> None:
        super().__init__(f"SDO abort 0x{code:08X}")
        self.code = int(code)
