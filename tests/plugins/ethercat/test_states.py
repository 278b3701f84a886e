"""AL states, supervision and EEPROM of the simulated slaves."""

from __future__ import annotations

import struct

import pytest
from tests.plugins.ethercat.line_master import (
    ACKNOWLEDGE,
    INIT,
    INPUTS,
    LOGICAL,
    OP,
    OUTPUTS,
    PRE_OP,
    SAFE_OP,
    LineMaster,
    master_of,
)

from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.datagrams import Command
from robotd_ethercat.simulated.fault_commands import inject

CYCLE_NS = 2_000_000
ERROR = 0x10


def clocked(master: LineMaster, slaves: int) -> None:
    """Start SYNC0 on slaves in SafeOp, and enter Op."""
    for slave in range(slaves):
        now = master.line.slaves[slave].controller.clock.system_time(master.now_ns)
        master.write(slave, reg.DC_START_TIME, struct.pack("<Q", now))
        master.write(slave, reg.DC_SYNC0_CYCLE, struct.pack("<I", CYCLE_NS))
        master.write(slave, reg.DC_ACTIVATION, b"\x03")
        master.write(slave, reg.AL_CONTROL, bytes([OP, 0]))


def cycle(master: LineMaster, slaves: int, count: int, period_ns: int = CYCLE_NS) -> None:
    for _ in range(count):
        master.now_ns += period_ns
        replies = master.exchange(
            (Command.LRW, LOGICAL & 0xFFFF, LOGICAL >> 16, bytes(8 * slaves)),
            (Command.ARMW, 0, reg.DC_SYSTEM_TIME, bytes(8)),
        )
        assert replies is not None
        master.line.tick(master.now_ns)


def test_all_transitions() -> None:
    master = master_of(1)
    master.op(0)
    for state in (SAFE_OP, PRE_OP, INIT):
        assert master.request(0, state) == (state, 0)
    master.op(0)
    assert master.request(0, INIT) == (INIT, 0)


@pytest.mark.parametrize(
    ("state", "code"), [(SAFE_OP, 0x11), (OP, 0x11), (3, 0x13), (5, 0x12), (0, 0x12)]
)
def test_requests_that_init_rejects(state: int, code: int) -> None:
    master = master_of(1)
    assert master.request(0, state) == (INIT | ERROR, code)
    assert master.request(0, INIT | ACKNOWLEDGE) == (INIT, 0)


def test_an_error_must_be_acknowledged_before_a_higher_state() -> None:
    master = master_of(1)
    master.op(0)
    inject(master.line, "0 al 0x1A")
    assert master.read(0, reg.AL_STATUS) == SAFE_OP | ERROR
    assert master.request(0, OP) == (SAFE_OP | ERROR, 0x1A)
    master.write(0, reg.AL_CONTROL, bytes([SAFE_OP | ACKNOWLEDGE, 0]))
    assert master.read(0, reg.AL_STATUS) == SAFE_OP
    assert inject(master.line, "0 state") == "SAFE_OP 0x0000"


@pytest.mark.parametrize(
    ("number", "start", "length", "control", "code"),
    [(2, OUTPUTS, 7, 0x64, 0x1D), (3, INPUTS, 9, 0x20, 0x1E), (2, OUTPUTS, 8, 0x20, 0x1D)],
)
def test_wrong_sync_managers_of_process_data(
    number: int, start: int, length: int, control: int, code: int
) -> None:
    master = master_of(1)
    master.safe_op(0)
    master.request(0, PRE_OP)
    master.sync_manager(0, number, start, length, control)
    assert master.request(0, SAFE_OP) == (PRE_OP | ERROR, code)


def test_op_needs_outputs() -> None:
    master = master_of(1)
    master.safe_op(0)
    assert master.request(0, OP) == (SAFE_OP, 0)
    master.wait(2.5)
    assert (master.read(0, reg.AL_STATUS), master.read(0, reg.AL_STATUS_CODE)) == (
        SAFE_OP | ERROR,
        0x19,
    )


def test_process_data_is_exchanged_from_safe_op_on() -> None:
    master = master_of(1)
    master.safe_op(0)
    assert master.logical(Command.LRW, LOGICAL, bytes(8)).counter == 3
    master.request(0, PRE_OP)
    assert master.logical(Command.LRW, LOGICAL, bytes(8)).counter == 0


def test_the_watchdog() -> None:
    master = master_of(1)
    master.op(0)
    cycle(master, 1, 100)
    assert master.read(0, reg.AL_STATUS) == OP
    master.wait(0.12)
    assert master.read(0, reg.AL_STATUS) == SAFE_OP | ERROR
    assert master.read(0, reg.AL_STATUS_CODE) == 0x1B
    assert master.read(0, reg.PROCESS_DATA_WATCHDOG_STATUS) == 0
    assert master.read(0, reg.PROCESS_DATA_WATCHDOG_COUNTER, 1) == 1


def test_the_master_disables_the_watchdog() -> None:
    master = master_of(1)
    master.op(0)
    master.write(0, reg.PROCESS_DATA_WATCHDOG_TIME, bytes(2))
    master.wait(0.5)
    assert master.read(0, reg.AL_STATUS) == OP


def test_clocks_are_controlled() -> None:
    master = master_of(3)
    for slave in range(3):
        master.safe_op(slave)
    for slave, drift in ((1, 100e-6), (2, -200e-6)):
        master.line.slaves[slave].controller.clock.set_drift(drift, master.now_ns)
    clocked(master, 3)
    cycle(master, 3, 500)
    clocks = [slave.controller.clock for slave in master.line.slaves]
    times = [clock.system_time(master.now_ns) for clock in clocks]
    assert max(times) - min(times) < 5000  # of 200 µs that the clocks would be apart
    assert master.read(1, reg.DC_DIFFERENCE, 4) & 0x7FFFFFFF < 1000
    assert [master.read(slave, reg.AL_STATUS) for slave in range(3)] == [OP] * 3


def test_a_wrong_offset_is_corrected_at_once() -> None:
    """A master reads a receive time too late and writes an offset that is seconds off."""
    master = master_of(2)
    for slave in range(2):
        master.safe_op(slave)
    clocked(master, 2)
    cycle(master, 2, 10)
    master.write(1, reg.DC_OFFSET, struct.pack("<Q", 5_000_000_000))
    cycle(master, 2, 10)
    assert [master.read(slave, reg.AL_STATUS) for slave in range(2)] == [OP, OP]
    assert master.read(1, reg.DC_DIFFERENCE, 4) & 0x7FFFFFFF < 10_000


def test_a_drift_that_cannot_be_corrected_is_an_error() -> None:
    master = master_of(2)
    for slave in range(2):
        master.safe_op(slave)
    clocked(master, 2)
    cycle(master, 2, 10)
    master.line.slaves[1].controller.clock.set_drift(0.01, master.now_ns)
    cycle(master, 2, 500)
    assert master.read(1, reg.AL_STATUS_CODE) == 0x32
    assert master.read(0, reg.AL_STATUS) == OP


def test_missing_frames_are_a_synchronisation_error() -> None:
    master = master_of(1)
    master.safe_op(0)
    master.line.slaves[0].objects.values[0x10F1, 2] = 150
    clocked(master, 1)
    cycle(master, 1, 100)
    cycle(master, 1, 60, period_ns=3 * CYCLE_NS)
    assert master.read(0, reg.AL_STATUS_CODE) == 0x1A


def test_missing_frames_are_tolerated_without_a_limit() -> None:
    master = master_of(1)
    master.safe_op(0)
    clocked(master, 1)
    cycle(master, 1, 100)
    cycle(master, 1, 500, period_ns=7 * CYCLE_NS)
    assert master.read(0, reg.AL_STATUS) == OP


def test_stalls_of_the_computer_expire_no_watchdog() -> None:
    master = master_of(1)
    master.op(0)
    for _ in range(50):
        cycle(master, 1, 1)
        for _ in range(4):  # each time longer than the slaves expect between two ticks
            master.now_ns += 40_000_000
            master.line.tick(master.now_ns)
    assert master.read(0, reg.AL_STATUS) == OP


def test_sync0_that_stops_is_an_error() -> None:
    master = master_of(1)
    master.safe_op(0)
    clocked(master, 1)
    cycle(master, 1, 5)
    inject(master.line, "0 sync0 off")
    cycle(master, 1, 1)
    assert master.read(0, reg.AL_STATUS_CODE) == 0x2C


def test_sync0_must_not_be_too_fast() -> None:
    master = master_of(1)
    master.safe_op(0)
    master.request(0, PRE_OP)
    master.write(0, reg.DC_SYNC0_CYCLE, struct.pack("<I", 1000))
    master.write(0, reg.DC_ACTIVATION, b"\x03")
    assert master.request(0, SAFE_OP) == (PRE_OP | ERROR, 0x35)


def test_receive_times_show_the_delay_of_the_line() -> None:
    master = master_of(3)
    master.do(Command.BWR, 0, reg.DC_RECEIVE_TIMES, bytes(4))
    ports = [
        (master.read(n, reg.DC_RECEIVE_TIMES, 4), master.read(n, reg.DC_RECEIVE_TIMES + 4, 4))
        for n in range(3)
    ]
    loops = [back - there for there, back in ports[:2]]
    assert loops[0] > loops[1] > 0
    assert ports[2][1] == 0  # nothing behind the last slave


def eeprom(master: LineMaster, word: int) -> bytes:
    """Read 8 bytes by the EEPROM interface."""
    master.write(0, reg.EEPROM_CONTROL, struct.pack("<HI", 0x0100, word))
    return master.read(0, reg.EEPROM_DATA, 8).to_bytes(8, "little")


def test_the_eeprom() -> None:
    master = master_of(1)
    assert struct.unpack("<II", eeprom(master, 8)) == (0x52424F54, 1)
    master.write(0, reg.EEPROM_DATA, b"\x11\x22")
    master.write(0, reg.EEPROM_CONTROL, struct.pack("<HI", 0x0201, 4))  # the alias
    assert eeprom(master, 4)[:2] == b"\x11\x22"
    inject(master.line, "0 identity 0x77 5")
    assert struct.unpack("<II", eeprom(master, 8)) == (0x77, 5)
    master.write(0, reg.EEPROM_CONTROL, struct.pack("<HI", 0x0300, 0))
    assert master.read(0, reg.EEPROM_CONTROL) & 0x2000


def test_the_categories_of_the_eeprom() -> None:
    master = master_of(1)
    image = b"".join(eeprom(master, word) for word in range(0, 512, 4))
    categories, position = {}, 0x80
    while (kind := int.from_bytes(image[position : position + 2], "little")) != 0xFFFF:
        size = 2 * int.from_bytes(image[position + 2 : position + 4], "little")
        categories[kind] = image[position + 4 : position + 4 + size]
        position += 4 + size
    assert sorted(categories) == [10, 30, 40, 41, 50, 51]
    assert categories[10][1:15] == bytes([13]) + b"Generic slave"
    sizes = [struct.unpack_from("<HH", categories[41], 8 * n) for n in range(4)]
    assert sizes == [(0x1000, 256), (0x1400, 256), (0x1800, 8), (0x2400, 8)]
    assert struct.unpack_from("<HBB", categories[51]) == (0x1600, 2, 2)
    assert struct.unpack_from("<HBBBB", categories[50], 8) == (0x6000, 1, categories[50][11], 7, 32)


@pytest.mark.parametrize("line", ["", "0", "9 off", "0 nothing", "0 al", "x off", "0 emcy x"])
def test_commands_that_are_not_understood(line: str) -> None:
    assert inject(master_of(1).line, line).startswith("not understood")
