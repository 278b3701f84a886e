"""Commands of datagrams and their working counters, on simulated slaves."""

from __future__ import annotations

import pytest
from tests.plugins.ethercat.line_master import (
    LOGICAL,
    OP,
    OUTPUTS,
    LineMaster,
    Port,
    frame_of,
    line_of,
    master_of,
)

from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.datagrams import Command

RAM = 0x2F00  # process RAM without a SyncManager


@pytest.fixture
def master() -> LineMaster:
    master = master_of(3)
    for slave in range(3):
        master.write(slave, reg.STATION_ADDRESS, (0x1001 + slave).to_bytes(2, "little"))
    return master


def ram(master: LineMaster) -> list[int]:
    return [slave.controller.memory[RAM] for slave in master.line.slaves]


def test_nop_changes_nothing(master: LineMaster) -> None:
    reply = master.do(Command.NOP, 0, RAM, b"\x55")
    assert (reply.data, reply.counter, reply.address) == (b"\x55", 0, 0)


@pytest.mark.parametrize("command", [15, 0x80, 255])
def test_an_unknown_command_changes_nothing(master: LineMaster, command: int) -> None:
    reply = master.do(command, 0, RAM, b"\x55")
    assert (reply.data, reply.counter, ram(master)) == (b"\x55", 0, [0, 0, 0])


def test_position_addressing(master: LineMaster) -> None:
    write = master.do(Command.APWR, -1, RAM, b"\x11")
    assert (write.counter, ram(master)) == (1, [0, 0x11, 0])
    assert write.address == 2  # -1 incremented by three slaves
    assert master.do(Command.APRD, -1, RAM, b"\0").data == b"\x11"
    both = master.do(Command.APRW, -1, RAM, b"\x22")
    assert (both.data, both.counter, ram(master)) == (b"\x11", 3, [0, 0x22, 0])
    assert master.do(Command.APRD, -3, RAM, b"\0").counter == 0  # behind the last slave


def test_station_addressing(master: LineMaster) -> None:
    write = master.do(Command.FPWR, 0x1003, RAM, b"\x33")
    assert (write.counter, write.address, ram(master)) == (1, 0x1003, [0, 0, 0x33])
    assert master.do(Command.FPRD, 0x1003, RAM, b"\0").data == b"\x33"
    both = master.do(Command.FPRW, 0x1003, RAM, b"\x44")
    assert (both.data, both.counter) == (b"\x33", 3)
    assert master.do(Command.FPRD, 0x1004, RAM, b"\0").counter == 0


def test_an_alias_counts_when_the_dl_control_register_enables_it(master: LineMaster) -> None:
    master.line.slaves[1].controller.put(reg.STATION_ALIAS, 2, 77)
    assert master.do(Command.FPRD, 77, RAM, b"\0").counter == 0
    master.write(1, reg.DL_CONTROL + 3, b"\x01")
    assert master.do(Command.FPRD, 77, RAM, b"\0").counter == 1
    assert master.do(Command.FPRD, 0x1002, RAM, b"\0").counter == 1


def test_broadcast_reads_are_combined_by_or(master: LineMaster) -> None:
    for slave in range(3):
        master.write(slave, RAM, bytes([1 << slave]))
    read = master.do(Command.BRD, 0, RAM, b"\x80")
    assert (read.data, read.counter, read.address) == (b"\x87", 3, 3)
    write = master.do(Command.BWR, 0, RAM, b"\x10")
    assert (write.counter, ram(master)) == (3, [0x10] * 3)
    both = master.do(Command.BRW, 0, RAM, b"\x20")
    assert both.counter == 9
    assert ram(master)[0] == 0x20


@pytest.mark.parametrize(("command", "address"), [(Command.ARMW, -1), (Command.FRMW, 0x1002)])
def test_one_slave_is_read_and_the_others_are_written(
    master: LineMaster, command: int, address: int
) -> None:
    master.write(1, RAM, b"\x99")
    reply = master.do(command, address, RAM, b"\x11")
    assert reply.counter == 3
    assert reply.data == b"\x99"
    assert ram(master) == [0x11, 0x99, 0x99]  # the first gets what the frame brought


def test_several_datagrams_in_a_frame(master: LineMaster) -> None:
    replies = master.exchange(
        (Command.APWR, 0, RAM, b"\x01"),
        (Command.BRD, 0, RAM, b"\0"),
        (Command.APRD, -2, RAM, b"\0\0"),
    )
    assert replies is not None
    assert [reply.counter for reply in replies] == [1, 3, 1]
    assert replies[1].data == b"\x01"


def test_logical_datagrams(master: LineMaster) -> None:
    for slave in range(3):
        master.op(slave)
    outputs = bytes(range(24))
    assert master.logical(Command.LWR, LOGICAL, outputs).counter == 3
    read = master.logical(Command.LRD, LOGICAL, bytes(24))
    assert (read.data, read.counter) == (outputs, 3)
    both = master.logical(Command.LRW, LOGICAL, bytes(24))
    assert (both.data, both.counter) == (outputs, 9)
    assert master.logical(Command.LRD, LOGICAL, bytes(24)).data == bytes(24)
    assert master.logical(Command.LRW, LOGICAL + 24, bytes(8)).counter == 0


def test_a_part_of_the_logical_area(master: LineMaster) -> None:
    for slave in range(3):
        master.op(slave)
    reply = master.logical(Command.LRW, LOGICAL + 12, b"\x01\x02\x03\x04\x05\x06")
    assert reply.counter == 6  # slaves 1 and 2
    memory = master.line.slaves[1].controller.memory
    assert bytes(memory[0x1800:0x1808]) == bytes(4) + b"\x01\x02\x03\x04"


def test_registers_of_the_slave_cannot_be_written(master: LineMaster) -> None:
    assert master.write(0, reg.AL_STATUS, b"\x08\x00") == 0
    assert master.read(0, reg.AL_STATUS) == 1


def test_access_behind_the_memory_fails(master: LineMaster) -> None:
    assert master.do(Command.APRD, 0, reg.MEMORY_SIZE - 1, bytes(2)).counter == 0
    assert master.write(0, reg.MEMORY_SIZE - 1, bytes(2)) == 0


def test_the_source_address_shows_that_slaves_processed_the_frame(master: LineMaster) -> None:
    answer = master.send(frame_of((Command.BRD, 0, 0, b"\0")))
    assert answer is not None
    assert answer[6] == 0x03


def test_a_cut_cable_hides_the_slaves_behind(master: LineMaster) -> None:
    master.line.cables[1].cut = True
    master.line.update()
    assert master.do(Command.BRD, 0, 0, b"\0").counter == 1
    assert master.read(0, reg.DL_STATUS) & 0x0030 == 0x0010
    assert master.line.slaves[0].controller.memory[reg.LOST_LINKS + 1] == 1
    assert master.line.slaves[1].controller.memory[reg.LOST_LINKS] == 1
    master.line.cables[0].cut = True
    master.line.update()
    assert master.exchange((Command.BRD, 0, 0, b"\0")) is None


def test_a_slave_without_power_starts_again_in_init(master: LineMaster) -> None:
    master.op(1)
    master.line.power(1, False, master.now_ns)
    assert master.do(Command.BRD, 0, 0, b"\0").counter == 1
    master.line.power(1, True, master.now_ns)
    assert master.do(Command.BRD, 0, 0, b"\0").counter == 3
    assert master.read(1, reg.AL_STATUS) == 1
    assert master.read(1, reg.STATION_ADDRESS) == 0


def test_a_ring_survives_a_cut() -> None:
    master = LineMaster(line_of(4, redundant=True))
    frame = frame_of((Command.BRD, 0, 0, b"\0"))
    master.line.buffer[: len(frame)] = frame
    assert master.line.forward(len(frame), 0) is Port.SECONDARY
    assert master.line.forward(len(frame), 0, Port.SECONDARY) is Port.PRIMARY
    master.line.cables[1].cut = True
    master.line.update()
    counters = []
    for port in Port:
        master.line.buffer[: len(frame)] = frame
        assert master.line.forward(len(frame), 0, port) is port
        counters.append(master.line.buffer[len(frame) - 2])
    assert counters == [1, 3]


def test_process_data_of_a_cut_ring_reach_the_slaves_of_each_end() -> None:
    master = LineMaster(line_of(2, redundant=True))
    master.op(0)
    master.op(1)
    master.line.cables[1].cut = True
    master.line.update()
    for port, reached in ((Port.PRIMARY, [7, 0]), (Port.SECONDARY, [7, 9])):
        outputs = bytes([7] * 8 + [9] * 8)
        frame = frame_of((Command.LRW, LOGICAL & 0xFFFF, LOGICAL >> 16, outputs))
        answer = master.send(frame, port)
        assert answer is not None
        assert answer[-2] == 3  # the working counter, of one slave
        memories = [slave.controller.memory for slave in master.line.slaves]
        assert [memory[OUTPUTS] for memory in memories] == reached


def test_corrupted_frames_are_lost_and_counted(master: LineMaster) -> None:
    master.op(0)
    master.line.cables[1].corruption = 1.0
    master.line.update()
    assert master.exchange((Command.BRD, 0, 0, b"\0")) is None
    counters = [slave.controller.memory[reg.RX_ERRORS] for slave in master.line.slaves]
    assert counters == [0, 1, 0]
    assert master.line.slaves[2].controller.memory[reg.FORWARDED_ERRORS] == 1
    master.line.cables[1].corruption = 0.0
    master.line.update()
    master.write(1, reg.RX_ERRORS, bytes(2))
    assert master.read(1, reg.RX_ERRORS) == 0
    assert master.read(0, reg.AL_STATUS) == OP


def test_a_part_of_the_frames_is_lost(master: LineMaster) -> None:
    master.line.cables[0].loss = 0.5
    master.line.update()
    results = [master.exchange((Command.BRD, 0, 0, b"\0")) for _ in range(100)]
    assert 20 < sum(result is None for result in results) < 80
