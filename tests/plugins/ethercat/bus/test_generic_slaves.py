"""Generic simulated slaves as pysoem sees them: an independent master."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import pysoem
import pytest
from tests.plugins.ethercat.bus.slaves_of import find_slaves

from robotd_ethercat.slaves_process import SlavesProcess

VENDOR, PRODUCT = 0x52424F54, 1
PATIENCE_S = 10.0


def exchange(master: pysoem.Master) -> int:
    """One cycle; a frame that comes late on a busy computer has a long time-out."""
    master.send_processdata()
    counter: int = master.receive_processdata(500_000)
    return counter


def until(condition: Callable[[], bool], master: pysoem.Master) -> None:
    """Exchange process data until ``condition``."""
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end, [hex(slave.al_status) for slave in master.slaves]
        exchange(master)
        master.read_state()
        time.sleep(0.001)


def enter_op(master: pysoem.Master) -> None:
    find_slaves(master, 3)
    master.config_map()
    assert master.state_check(pysoem.SAFEOP_STATE, 2_000_000) == pysoem.SAFEOP_STATE
    master.state = pysoem.OP_STATE
    master.write_state()
    until(lambda: all(slave.state == pysoem.OP_STATE for slave in master.slaves), master)


def test_identity_and_names_come_from_the_eeprom(opened: pysoem.Master) -> None:
    find_slaves(opened, 3)
    for slave in opened.slaves:
        assert (slave.man, slave.id, slave.name) == (VENDOR, PRODUCT, "Generic slave")
        assert slave.sdo_read(0x1018, 1) == VENDOR.to_bytes(4, "little")


def test_process_data_in_op(opened: pysoem.Master) -> None:
    enter_op(opened)
    assert opened.expected_wkc == 9
    for number, slave in enumerate(opened.slaves):
        slave.output = bytes([number]) * 8
    until(lambda: [slave.input[0] for slave in opened.slaves] == [0, 1, 2], opened)
    assert exchange(opened) == 9


def test_sdo_of_all_lengths(opened: pysoem.Master) -> None:
    find_slaves(opened, 3)
    slave = opened.slaves[1]
    slave.sdo_write(0x2000, 0, b"\x01\x02\x03\x04")
    assert slave.sdo_read(0x2000, 0) == b"\x01\x02\x03\x04"
    for length in (1, 5, 239, 240, 241, 512):  # expedited, in one message, segmented
        data = os.urandom(length)
        slave.sdo_write(0x2001, 0, data)
        assert slave.sdo_read(0x2001, 0, 600) == data


def test_sdo_aborts(opened: pysoem.Master, generic_slaves: SlavesProcess) -> None:
    find_slaves(opened, 3)
    slave = opened.slaves[0]
    with pytest.raises(pysoem.SdoError) as missing:
        slave.sdo_read(0x5555, 0)
    assert missing.value.abort_code == 0x06020000
    with pytest.raises(pysoem.SdoError) as read_only:
        slave.sdo_write(0x1000, 0, bytes(4))
    assert read_only.value.abort_code == 0x06010002
    generic_slaves.inject("0 abort 0x2000 0x08000020")
    with pytest.raises(pysoem.SdoError) as injected:
        slave.sdo_read(0x2000, 0)
    assert injected.value.abort_code == 0x08000020


def test_object_dictionary_information(opened: pysoem.Master) -> None:
    find_slaves(opened, 3)
    objects = {found.index: found for found in opened.slaves[0].od}
    assert objects[0x1018].name == b"Identity"
    assert [entry.name for entry in objects[0x7000].entries][1:] == [b"Output 1", b"Output 2"]
    assert objects[0x2000].bit_length == 32


def test_distributed_clocks(opened: pysoem.Master) -> None:
    find_slaves(opened, 3)
    opened.config_map()
    assert opened.config_dc()
    for slave in opened.slaves:
        slave.dc_sync(act=True, sync0_cycle_time=2_000_000)
    before = opened.dc_time
    until(lambda: opened.dc_time - before > 20_000_000, opened)

    def difference_ns(slave: pysoem.CdefSlave) -> int:
        return int.from_bytes(slave._fprd(0x092C, 4), "little") & 0x7FFFFFFF

    until(lambda: all(difference_ns(slave) < 1000 for slave in opened.slaves[1:]), opened)


def test_a_wrong_request_is_answered_with_an_al_status_code(opened: pysoem.Master) -> None:
    find_slaves(opened, 3)
    slave = opened.slaves[2]
    slave.state = pysoem.OP_STATE  # from PreOp
    slave.write_state()
    slave.state_check(pysoem.OP_STATE, 20_000)
    opened.read_state()
    assert slave.al_status == 0x11
    assert slave.state == pysoem.PREOP_STATE | pysoem.STATE_ERROR


def test_faults(opened: pysoem.Master, generic_slaves: SlavesProcess) -> None:
    enter_op(opened)
    generic_slaves.inject("1 cut")
    until(lambda: exchange(opened) == 3, opened)
    generic_slaves.inject("1 join")
    until(lambda: exchange(opened) == 9, opened)
    generic_slaves.inject("0 al 0x1A")
    until(lambda: opened.slaves[0].al_status == 0x1A, opened)
    generic_slaves.inject("2 off")
    generic_slaves.inject("1 identity 0x1234")
    find_slaves(opened, 2)
    assert opened.slaves[1].man == 0x1234


def test_an_emergency_reaches_the_master(
    opened: pysoem.Master, generic_slaves: SlavesProcess
) -> None:
    find_slaves(opened, 3)
    found: list[int] = []
    opened.slaves[1].add_emergency_callback(lambda emergency: found.append(emergency.error_code))
    generic_slaves.inject("1 emcy 0x3210")
    opened.slaves[1].sdo_read(0x2000, 0)
    assert found == [0x3210]
