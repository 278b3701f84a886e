"""The first 4 KiB of a slave controller's memory, as a master would read it.

Register addresses and bits as in the public register descriptions of EtherCAT slave
controllers (ETG.1000.4 and vendors' data sheets). AL states have the controller's own numbers
there: Init 1, Preop 2, Boot 3, Safeop 4, Op 8.
"""

from __future__ import annotations

import struct

from robotd.api import BusState
from robotd_sim.network import Slave

MEMORY_BYTES = 0x1000

_ESC_STATE = {
    BusState.UNKNOWN: 0x00,
    BusState.CONFIGURABLE: 0x02,  # Preop
    BusState.OPERATIONAL: 0x08,  # Op
}

_TYPE, _REVISION, _BUILD = 0x11, 0x02, 0x0001
_FMMUS = _SYNC_MANAGERS = 8
_RAM_KIB = 8
_PORTS_0_AND_1_MII = 0x0F
_FEATURES_DC_64_BIT = 0x000C
_WATCHDOG_DIVIDER, _WATCHDOG_PERIODS = 0x09C2, 0x03E8  # power-on values: 100 µs, 100 ms


def memory(slave: Slave, *, communicating: bool, last: bool, system_time_ns: int) -> bytes:
    """The registers of ``slave``; ``last`` is the one at the end of the line."""
    image = bytearray(MEMORY_BYTES)
    state = _ESC_STATE[slave.state(communicating=communicating)]

    def put(address: int, layout: str, *values: int) -> None:
        struct.pack_into("<" + layout, image, address, *values)

    put(0x0000, "BBHBBBBH", _TYPE, _REVISION, _BUILD, _FMMUS, _SYNC_MANAGERS, _RAM_KIB,
        _PORTS_0_AND_1_MII, _FEATURES_DC_64_BIT)  # fmt: skip
    put(0x0010, "HH", slave.address, 0)  # station address, alias
    put(0x0110, "H", _link_status(last=last))
    put(0x0120, "H", state)  # AL control: state requested by the master
    put(0x0130, "H", state)  # AL status
    put(0x0134, "H", 0)  # AL status code
    # 0x0300 to 0x0313: receive errors, forwarded errors and lost links of the ports, all 0
    put(0x0400, "H", _WATCHDOG_DIVIDER)
    put(0x0410, "H", _WATCHDOG_PERIODS)  # of the process data interface
    put(0x0420, "H", _WATCHDOG_PERIODS)  # of the process data
    put(0x0440, "H", 1 if communicating else 0)  # process data watchdog: 1 while fed
    put(0x0910, "Q", system_time_ns)
    put(0x0928, "I", 700 * slave.id)  # delay from the reference clock, ns
    return bytes(image)


def _link_status(*, last: bool) -> int:
    """Return the DL status: ports 0 and 1; only port 0 of the last slave."""
    operational, watchdog = 1 << 0, 1 << 1
    links = 1 << 4 if last else 1 << 4 | 1 << 5
    communication = 1 << 9 if last else 1 << 9 | 1 << 11
    closed = (1 << 10 if last else 0) | 1 << 12 | 1 << 14
    return operational | watchdog | links | communication | closed
