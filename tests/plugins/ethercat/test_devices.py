"""Simulated servo drive and I/O module, driven through frames."""

from __future__ import annotations

import struct

import pytest
from tests.plugins.ethercat.line_master import (
    LOGICAL,
    OP,
    PRE_OP,
    SAFE_OP,
    START_NS,
    LineMaster,
)

from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd_cia402.simulated import DriveModel, Motors, Scale
from robotd_ethercat.simulated import Identity, IoModule, Line, MotionClock, ServoDrive
from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.datagrams import Command
from robotd_ethercat.simulated.fault_commands import inject
from robotd_ethercat.simulated_robot import simulated_line

COUNTS = 1e5
PERIOD_NS = 4_000_000
FAULT, ENABLED = 0x08, 0x37
POSITION_MODE = 8
OUT, IN = struct.Struct("<Hbii"), struct.Struct("<HbiihHI")


class Cell:
    """One drive and one I/O module with a byte each way, in Op."""

    def __init__(self) -> None:
        machine = Motors([0.0], START_NS)
        model = DriveModel(0, Scale(COUNTS, COUNTS, COUNTS))
        self.drive = ServoDrive(Identity(1, 2), machine, [model], START_NS)
        self.module = IoModule(Identity(1, 3), 1, 1, START_NS)
        self.line = Line([self.drive, self.module], motion=MotionClock(machine, [self.drive]))
        self.master = LineMaster(self.line)
        self.bring_up()

    def bring_up(self) -> None:
        self.master.safe_op(0, OUT.size, IN.size)
        self.master.safe_op(1, 1, 1)
        self.master.fmmu(1, 0, LOGICAL + 32, 0x1800, 2, 1)  # behind the drive
        self.master.fmmu(1, 1, LOGICAL + 32, 0x2400, 1, 1)
        for slave in range(2):
            self.master.write(slave, reg.AL_CONTROL, bytes([OP, 0]))
        self.cycle()
        assert [self.master.read(slave, reg.AL_STATUS) for slave in range(2)] == [OP, OP]

    def cycle(
        self, controlword: int = 0, position: int = 0, outputs: int = 0, count: int = 1
    ) -> tuple[int, ...]:
        """Exchange ``count`` frames; return the inputs of the drive."""
        data = OUT.pack(controlword, POSITION_MODE, position, 0).ljust(32, b"\0")
        for _ in range(count):
            self.master.now_ns += PERIOD_NS
            self.line.tick(self.master.now_ns)
            reply = self.master.logical(Command.LRW, LOGICAL, data + bytes([outputs]))
        self.inputs = reply.data[32]
        return IN.unpack_from(reply.data)

    def enable(self) -> None:
        position = self.cycle()[2]
        word_back = 0
        for word in (0x80, 0x06, 0x07, 0x0F):
            word_back, _, position, *_ = self.cycle(word, position, count=3)
        assert word_back & 0x3F == ENABLED


@pytest.fixture
def cell() -> Cell:
    return Cell()


def test_a_drive_follows_positions(cell: Cell) -> None:
    cell.enable()
    for step in range(100):
        cell.cycle(0x0F, step * 100)
    word, mode, position, *_ = cell.cycle(0x0F, 9900, count=100)
    assert (word & 0x3F, mode) == (ENABLED, POSITION_MODE)
    assert position == pytest.approx(9900, abs=20)
    assert float(inject(cell.line, "0 position")) == pytest.approx(0.099, abs=1e-3)


def test_a_trip_stops_the_drive_and_sends_an_emergency(cell: Cell) -> None:
    cell.enable()
    assert inject(cell.line, "0 trip 0x3210") == "ok"
    word, _, _, _, _, code, _ = cell.cycle(0x0F, count=100)
    assert (word & 0x4F, code) == (FAULT, 0x3210)
    kind, data = cell.master.mailbox_receive(0) or (0, b"")
    assert (kind, data[2:4]) == (3, b"\x10\x32")
    cell.cycle(0x00)
    assert cell.cycle(0x80, count=3)[5] == 0


def test_an_enabled_drive_trips_when_it_leaves_op(cell: Cell) -> None:
    cell.enable()
    cell.master.wait(0.3)  # no frames: the watchdog
    assert cell.master.read(0, reg.AL_STATUS) == SAFE_OP | 0x10
    assert cell.master.read(0, reg.AL_STATUS_CODE) == 0x1B
    assert cell.drive.objects.values[0x603F, 0] == 0x8130
    assert cell.master.read(1, reg.AL_STATUS_CODE) == 0x1B


def test_a_drive_that_is_not_enabled_leaves_op_without_a_fault(cell: Cell) -> None:
    assert cell.master.request(0, PRE_OP) == (PRE_OP, 0)
    assert cell.drive.objects.values[0x603F, 0] == 0


def test_a_pause_of_the_simulation_expires_no_watchdog(cell: Cell) -> None:
    cell.enable()
    cell.master.now_ns += 300_000_000  # neither tick nor frame: the computer was stalled
    cell.line.tick(cell.master.now_ns)
    assert cell.master.read(0, reg.AL_STATUS) == OP
    assert cell.cycle(0x0F)[0] & 0x3F == ENABLED


def test_the_power_supply_fails(cell: Cell) -> None:
    cell.enable()
    inject(cell.line, "0 off")
    assert cell.master.exchange((Command.BRD, 0, 0, b"\0")) is None
    inject(cell.line, "0 on")
    cell.bring_up()
    assert cell.cycle()[0] & 0x4F == 0x40  # switch on disabled, no fault


def test_push_and_switch(cell: Cell) -> None:
    inject(cell.line, "0 push 0.5")
    inject(cell.line, "0 press 1 1")
    _, _, position, _, _, _, switches = cell.cycle(count=3)
    assert position == pytest.approx(0.5 * COUNTS, abs=5)
    assert switches == 2


def test_inputs_and_outputs(cell: Cell) -> None:
    cell.cycle(outputs=0x05)
    assert [inject(cell.line, f"1 output 0 {bit}") for bit in range(3)] == ["1", "0", "1"]
    inject(cell.line, "1 input 0 7 1")
    cell.cycle(outputs=0x05)
    assert cell.inputs == 0x80
    cell.master.request(1, SAFE_OP)
    assert cell.module.output(0) == 0


def test_the_mapping_is_chosen_in_pre_op(cell: Cell) -> None:
    master = cell.master
    master.request(0, PRE_OP)
    for sub, value in ((0, b"\0"), (1, b"\x01\x16"), (0, b"\1")):
        size = 4 - len(value)
        command = 0x23 | size << 2
        request = struct.pack("<HBHB", 2 << 12, command, 0x1C12, sub) + value.ljust(4, b"\0")
        master.mailbox_send(0, request)
        answer = master.mailbox_receive(0)
        assert answer is not None
        assert answer[1][2] == 0x60, answer
    status = master.request(0, SAFE_OP)
    assert status == (PRE_OP | 0x10, 0x1D)  # the SyncManager has the length of the other PDO
    master.sync_manager(0, 2, 0x1800, 7, 0x64)
    assert master.request(0, SAFE_OP | 0x10) == (SAFE_OP, 0)


def test_a_module_of_many_bytes_has_several_pdos() -> None:
    module = IoModule(Identity(1, 2), 130, 65, START_NS)
    assert (module.inputs.size, module.outputs.size) == (130, 65)
    assert module.objects.values[0x1C13, 0] == 3
    module.set_input_bit(129, 2, value=True)
    assert module.objects.values[0x6020, 2] == 4


def test_the_slaves_of_a_robot() -> None:
    robot = load_robot_descriptor("cr3a", "ethercat_simulated")
    written = robot.model_dump_json(by_alias=True, exclude_unset=True)
    line = simulated_line(RobotDescriptor.model_validate_json(written))
    kinds = [type(slave).__name__ for slave in line.slaves]
    assert kinds == ["ServoDrive"] * 6 + ["IoModule"]
    assert [slave.identity.serial for slave in line.slaves] == list(range(1, 8))
