"""AL states and AL status codes in words (ETG.1000.6, table 10; ETG.1020, AL status codes)."""

from __future__ import annotations

from enum import IntEnum

ERROR_FLAG = 0x10  # of an AL status register: the slave rejected or left a state
_VENDOR = 0x8000


class AlState(IntEnum):
    """State of one slave; NONE without an answer."""

    NONE = 0
    INIT = 1
    PRE_OP = 2
    BOOT = 3
    SAFE_OP = 4
    OP = 8

    @property
    def text(self) -> str:
        """Name as on drives and in manuals."""
        return _NAMES[self]


_NAMES = {
    AlState.NONE: "no answer",
    AlState.INIT: "Init",
    AlState.PRE_OP: "PreOp",
    AlState.BOOT: "Boot",
    AlState.SAFE_OP: "SafeOp",
    AlState.OP: "Op",
}

_STATES = {state.value: state for state in AlState}

AL_STATUS_CODES: dict[int, tuple[str, str]] = {
    0x0000: ("no error", ""),
    0x0001: ("unspecified error", "read the drive's own display or log"),
    0x0002: ("no memory", "map fewer objects"),
    0x0003: ("invalid device setup", "check the modules of the slave"),
    0x0004: ("invalid revision", "compare firmware and SII of the slave"),
    0x0006: ("SII and firmware do not match", "write the SII that belongs to the firmware"),
    0x0007: ("firmware update failed, the old firmware runs", "repeat the update"),
    0x000E: ("licence error", "enter the licence of the slave"),
    0x0011: ("invalid requested state change", "start the communication again"),
    0x0012: ("unknown requested state", "start the communication again"),
    0x0013: ("boot state not supported", "update the firmware in another way"),
    0x0014: ("no valid firmware", "update the firmware"),
    0x0015: ("invalid mailbox configuration in Boot", "check the SII of the slave"),
    0x0016: ("invalid mailbox configuration in PreOp", "check the SII of the slave"),
    0x0017: ("invalid sync manager configuration", "check the mapping: rx_pdos and tx_pdos"),
    0x0018: ("no valid inputs available", "check the modules of the slave"),
    0x0019: ("no valid outputs", "check that process data arrive before Op is requested"),
    0x001A: ("synchronization error", "check `clocks` and the period; measure the jitter"),
    0x001B: ("sync manager watchdog: no process data in time", "check cable and computer load"),
    0x001C: ("invalid sync manager types", "check the SII of the slave"),
    0x001D: ("invalid output configuration", "check rx_pdos: its size differs from the slave's"),
    0x001E: ("invalid input configuration", "check tx_pdos: its size differs from the slave's"),
    0x001F: ("invalid watchdog configuration", "check watchdog_ms"),
    0x0020: ("the slave needs a cold start", "switch its supply off and on"),
    0x0021: ("the slave needs Init", "start the communication again"),
    0x0022: ("the slave needs PreOp", "start the communication again"),
    0x0023: ("the slave needs SafeOp", "start the communication again"),
    0x0024: ("invalid input mapping", "check tx_pdos: an object cannot be mapped"),
    0x0025: ("invalid output mapping", "check rx_pdos: an object cannot be mapped"),
    0x0026: ("inconsistent settings", "check the start-up objects"),
    0x0027: ("free run not supported", "use clocks: sync0"),
    0x0028: ("synchronization mode not supported", "change `clocks` (sync0 or off)"),
    0x0029: ("free run needs three buffers", "use clocks: sync0"),
    0x002A: ("background watchdog", "read the drive's own display or log"),
    0x002B: ("no valid inputs and outputs", "check the modules of the slave"),
    0x002C: ("fatal synchronization error: SYNC0 is missing", "check `clocks`; switch it off"),
    0x002D: ("no synchronization error: SYNC0 was not received", "check `clocks`"),
    0x002E: ("cycle time too small", "lower cycle.rate_hz"),
    0x0030: ("invalid DC SYNC configuration", "use clocks: off, or another rate"),
    0x0031: ("invalid DC latch configuration", "check the start-up objects"),
    0x0032: (
        "PLL error: frames and SYNC0 drift",
        "measure the jitter; see `robotd ethercat doctor`",
    ),
    0x0033: ("DC synchronization I/O error", "measure the jitter; see `robotd ethercat doctor`"),
    0x0034: ("DC synchronization time-out", "measure the jitter; see `robotd ethercat doctor`"),
    0x0035: ("invalid DC cycle time", "use a rate that the drive supports"),
    0x0036: ("invalid DC SYNC0 cycle time", "use a rate that the drive supports"),
    0x0037: ("invalid DC SYNC1 cycle time", "use a rate that the drive supports"),
    0x0041: ("AoE mailbox error", "read the drive's own display or log"),
    0x0042: ("EoE mailbox error", "read the drive's own display or log"),
    0x0043: ("CoE mailbox error", "read the drive's own display or log"),
    0x0044: ("FoE mailbox error", "read the drive's own display or log"),
    0x0045: ("SoE mailbox error", "read the drive's own display or log"),
    0x004F: ("VoE mailbox error", "read the drive's own display or log"),
    0x0050: ("no access to the EEPROM", "start the communication again"),
    0x0051: ("EEPROM error", "check the SII of the slave"),
    0x0052: ("external hardware not ready", "check the power supply of the drive"),
    0x0060: ("the slave restarted by itself", "check its supply; start the communication again"),
    0x0061: ("the device identification was changed", "switch its supply off and on"),
    0x0070: ("detected modules differ from the configured ones", "check the modules of the slave"),
    0x0080: ("supply voltage too low", "check the supply of the slave"),
    0x0081: ("supply voltage too high", "check the supply of the slave"),
    0x0082: ("temperature too low", "check the cabinet"),
    0x0083: ("temperature too high", "check the cabinet"),
    0x00F0: ("application controller available", ""),
}
"""AL status code → meaning, and what to do."""


def al_code_text(code: int) -> str:
    """Return ``AL status 0x001B: sync manager watchdog …``; "" for 0."""
    if not code:
        return ""
    if code in AL_STATUS_CODES:
        meaning, remedy = AL_STATUS_CODES[code]
        return f"AL status 0x{code:04X}: {meaning}" + (f"; {remedy}" if remedy else "")
    kind = "vendor specific, see the drive's manual" if code >= _VENDOR else "unknown"
    return f"AL status 0x{code:04X}: {kind}"


def al_state(register: int) -> AlState:
    """Return the state in an AL status register."""
    return _STATES.get(register & 0x0F, AlState.NONE)
