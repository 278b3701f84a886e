"""Simulated servo drives and I/O of a robot as pysoem sees them: an independent master."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterator

import pysoem
import pytest
from tests.plugins.ethercat.bus.slaves_of import find_slaves

from robotd_ethercat.bus_namespace import run_in_namespace
from robotd_ethercat.slaves_process import SlavesProcess

PATIENCE_S = 10.0
POSITION_MODE = 8
OUTPUTS, INPUTS = struct.Struct("<Hbii"), struct.Struct("<HbiihHI")
STATUSWORD, POSITION, ERROR_CODE = 0, 2, 5
DRIVES = 6
WATCHDOG_MS = 600  # longer than a stall of the computer


class Bus:
    """Master with all slaves in Op; ``outputs`` of the drives are sent in each cycle."""

    def __init__(self, master: pysoem.Master) -> None:
        self.master = master
        self.controlword, self.positions = 0, [0] * DRIVES
        find_slaves(master, DRIVES + 1)
        master.config_map()
        for slave in master.slaves:
            slave.set_watchdog("processdata", WATCHDOG_MS)
        assert master.state_check(pysoem.SAFEOP_STATE, 2_000_000) == pysoem.SAFEOP_STATE
        master.state = pysoem.OP_STATE
        master.write_state()
        self.until(self.in_op)

    def in_op(self) -> bool:
        self.master.read_state()
        return all(slave.state == pysoem.OP_STATE for slave in self.master.slaves)

    def cycle(self) -> int:
        for slave, position in zip(self.master.slaves[:DRIVES], self.positions, strict=True):
            slave.output = OUTPUTS.pack(self.controlword, POSITION_MODE, position, 0)
        self.master.send_processdata()
        counter: int = self.master.receive_processdata(500_000)
        return counter

    def inputs(self, slave: int) -> tuple[int, ...]:
        return INPUTS.unpack(self.master.slaves[slave].input)

    def until(self, condition: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end, [hex(slave.al_status) for slave in self.master.slaves]
            self.cycle()
            time.sleep(0.002)

    def enable(self) -> None:
        for word, state in ((0x80, 0x40), (0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
            self.controlword = word
            self.positions = [self.inputs(slave)[POSITION] for slave in range(DRIVES)]
            self.until(
                lambda state=state: all(  # type: ignore[misc]
                    self.inputs(slave)[STATUSWORD] & 0x6F == state for slave in range(DRIVES)
                )
            )


@pytest.fixture(scope="module")
def slaves() -> Iterator[SlavesProcess]:
    with SlavesProcess(["--robot", "cr3a", "--variant", "ethercat_simulated"]) as slaves:
        yield slaves


@pytest.fixture
def bus(slaves: SlavesProcess) -> Iterator[Bus]:
    """All slaves in Op, without faults."""
    for slave in range(DRIVES + 1):
        slaves.inject(f"{slave} heal")
        slaves.inject(f"{slave} off")
        slaves.inject(f"{slave} on")
    master = pysoem.Master()
    run_in_namespace(slaves.namespace, lambda: master.open(slaves.interface))
    yield Bus(master)
    master.close()


def test_drives_move_and_trip(bus: Bus, slaves: SlavesProcess) -> None:
    bus.enable()
    target = [position + 500 for position in bus.positions]
    while bus.positions != target:
        bus.positions = [position + 10 for position in bus.positions]
        bus.cycle()
    bus.until(lambda: all(abs(bus.inputs(n)[POSITION] - target[n]) < 50 for n in range(DRIVES)))
    slaves.inject("2 trip 0x3210")
    bus.until(lambda: bus.inputs(2)[ERROR_CODE] == 0x3210)
    assert bus.inputs(3)[ERROR_CODE] == 0


def test_inputs_and_outputs(bus: Bus, slaves: SlavesProcess) -> None:
    module = bus.master.slaves[DRIVES]
    module.output = b"\x05\x80"
    bus.until(lambda: slaves.inject("6 output 1 7") == "1")
    assert [slaves.inject(f"6 output 0 {bit}") for bit in range(3)] == ["1", "0", "1"]
    slaves.inject("6 input 1 3 1")
    bus.until(lambda: module.input == b"\x00\x08")


def test_a_cut_cable_stops_the_drives_behind(bus: Bus, slaves: SlavesProcess) -> None:
    bus.enable()
    slaves.inject("3 cut")
    bus.until(lambda: bus.cycle() == 9)  # three drives are left
    bus.until(lambda: slaves.inject("3 state") == "SAFE_OP 0x001B")  # watchdog
    slaves.inject("3 join")
    bus.until(lambda: bus.cycle() == 21)
    bus.until(lambda: bus.inputs(3)[ERROR_CODE] == 0x8130)
    assert bus.inputs(0)[STATUSWORD] & 0x6F == 0x27
