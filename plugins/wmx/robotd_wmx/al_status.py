"""AL status codes of EtherCAT slaves in words; numbers and meanings are those of ETG.1000.6."""

from __future__ import annotations

TEXTS = {
    0x0001: "unspecified error",
    0x0002: "no memory",
    0x0011: "invalid change of state was requested",
    0x0012: "unknown state was requested",
    0x0013: "it cannot start a boot loader",
    0x0014: "no valid firmware",
    0x0015: "invalid mailbox settings for the boot loader",
    0x0016: "invalid mailbox settings",
    0x0017: "invalid sync manager settings",
    0x0018: "no valid inputs",
    0x0019: "no valid outputs",
    0x001A: "synchronisation lost",
    0x001B: "no process data within the sync manager's watchdog",
    0x001C: "invalid kinds of sync managers",
    0x001D: "invalid output settings",
    0x001E: "invalid input settings",
    0x001F: "invalid watchdog settings",
    0x0020: "it needs a cold start",
    0x0021: "it needs to go through Init",
    0x0022: "it needs to go through Preop",
    0x0023: "it needs to go through Safeop",
    0x002C: "fatal synchronisation error",
    0x002D: "no synchronisation signal",
    0x0030: "invalid settings of the distributed clocks",
    0x0031: "invalid latch settings of the distributed clocks",
    0x0032: "its clock did not lock on",
    0x0033: "synchronisation error of its inputs or outputs",
    0x0034: "synchronisation timed out",
    0x0050: "its EEPROM cannot be accessed",
    0x0051: "EEPROM error",
}


def text_of_al(code: int) -> str:
    """Return ``no valid outputs (AL status 0x0019)``; "" for 0."""
    if not code:
        return ""
    number = f"AL status 0x{code:04X}"
    return f"{TEXTS[code]} ({number})" if code in TEXTS else number
