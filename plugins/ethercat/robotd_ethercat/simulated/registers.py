"""Registers of an EtherCAT slave controller (ETG.1000.4, as vendors' manuals list them)."""

from __future__ import annotations

STATION_ADDRESS = 0x0010
STATION_ALIAS = 0x0012
DL_CONTROL = 0x0100
DL_STATUS = 0x0110
AL_CONTROL = 0x0120
AL_STATUS = 0x0130
AL_STATUS_CODE = 0x0134
PDI_CONTROL = 0x0140
RX_ERRORS = 0x0300  # per port: invalid frames, RX errors
FORWARDED_ERRORS = 0x0308
PROCESSING_ERRORS = 0x030C
LOST_LINKS = 0x0310
WATCHDOG_DIVIDER = 0x0400
PDI_WATCHDOG_TIME = 0x0410
PROCESS_DATA_WATCHDOG_TIME = 0x0420
PROCESS_DATA_WATCHDOG_STATUS = 0x0440
PROCESS_DATA_WATCHDOG_COUNTER = 0x0442
EEPROM_CONFIG = 0x0500
EEPROM_CONTROL = 0x0502
EEPROM_ADDRESS = 0x0504
EEPROM_DATA = 0x0508
FMMU = 0x0600
FMMU_SIZE, FMMU_COUNT = 16, 8
SYNC_MANAGER = 0x0800
SYNC_MANAGER_SIZE, SYNC_MANAGER_COUNT = 8, 8
DC_RECEIVE_TIMES = 0x0900
DC_SYSTEM_TIME = 0x0910
DC_PROCESSING_UNIT_TIME = 0x0918
DC_OFFSET = 0x0920
DC_DELAY = 0x0928
DC_DIFFERENCE = 0x092C
DC_SPEED_START = 0x0930
DC_ACTIVATION = 0x0981
DC_START_TIME = 0x0990
DC_SYNC0_CYCLE = 0x09A0
PROCESS_RAM = 0x1000  # registers end here
MEMORY_SIZE = 0x3000

_WRITABLE = (
    (STATION_ADDRESS, 2),
    (0x0020, 2),
    (0x0030, 2),
    (0x0040, 2),
    (DL_CONTROL, 4),
    (AL_CONTROL, 2),
    (0x0200, 4),
    (RX_ERRORS, 0x14),
    (WATCHDOG_DIVIDER, 2),
    (PDI_WATCHDOG_TIME, 2),
    (PROCESS_DATA_WATCHDOG_TIME, 2),
    (PROCESS_DATA_WATCHDOG_COUNTER, 2),
    (EEPROM_CONFIG, 0x10),
    (FMMU, FMMU_SIZE * FMMU_COUNT),
    (DC_RECEIVE_TIMES, 4),
    (DC_SYSTEM_TIME, 8),
    (DC_OFFSET, 8),
    (DC_DELAY, 4),
    (DC_SPEED_START, 6),
    (0x0980, 4),
    (DC_START_TIME, 8),
    (DC_SYNC0_CYCLE, 8),
)


def writable_mask() -> bytes:
    """Return one byte for each register address: 1 where the master may write."""
    mask = bytearray(PROCESS_RAM)
    for start, length in _WRITABLE:
        mask[start : start + length] = bytes([1]) * length
    for number in range(SYNC_MANAGER_COUNT):
        start = SYNC_MANAGER + number * SYNC_MANAGER_SIZE
        mask[start : start + 5] = bytes([1]) * 5  # start, length, control
        mask[start + 6] = 1  # activate; status and PDI control belong to the slave
    return bytes(mask)
