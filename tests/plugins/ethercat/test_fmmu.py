"""Bits that FMMUs map, compared with a model that moves one bit at a time."""

from __future__ import annotations

import struct

from hypothesis import given
from hypothesis import strategies as st
from tests.plugins.ethercat.line_master import LOGICAL, master_of

from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.datagrams import Command
from robotd_ethercat.simulated.sync_manager import Fmmu

RAM = 0x2F00  # process RAM without a SyncManager
SIZE = 16


def bits_of(data: bytes) -> list[int]:
    return [data[n // 8] >> n % 8 & 1 for n in range(8 * len(data))]


@given(
    start=st.integers(0, 8),
    length=st.integers(1, 6),
    start_bit=st.integers(0, 7),
    stop_bit=st.integers(0, 7),
    memory_bit=st.integers(0, 7),
    first=st.integers(0, 8),
    incoming=st.binary(min_size=1, max_size=SIZE),
    memory=st.binary(min_size=SIZE, max_size=SIZE),
)
def test_each_bit_goes_where_the_fmmu_maps_it(
    start: int,
    length: int,
    start_bit: int,
    stop_bit: int,
    memory_bit: int,
    first: int,
    incoming: bytes,
    memory: bytes,
) -> None:
    master = master_of(1)
    master.write(0, RAM, memory)
    registers = struct.pack(
        "<IHBBHBBB3x", LOGICAL + start, length, start_bit, stop_bit, RAM, memory_bit, 3, 1
    )
    master.write(0, reg.FMMU, registers)
    reply = master.logical(Command.LRW, LOGICAL + first, incoming)

    logical = range(8 * start + start_bit, 8 * (start + length - 1) + stop_bit + 1)
    before, sent = bits_of(memory), bits_of(incoming)
    expected_memory, expected_data, mapped = before.copy(), sent.copy(), False
    for number, bit in enumerate(logical):
        place = bit - 8 * first
        if 0 <= place < len(sent):
            mapped = True
            expected_memory[memory_bit + number] = sent[place]
            expected_data[place] = sent[place]  # outputs are written first, then read back
    assert bits_of(bytes(master.line.slaves[0].controller.memory[RAM : RAM + SIZE])) == (
        expected_memory
    )
    assert bits_of(reply.data) == expected_data
    assert reply.counter == (3 if mapped else 0)


def test_bits_of_several_slaves_share_a_byte() -> None:
    master = master_of(3)
    for slave, (start_bit, stop_bit) in enumerate(((0, 1), (2, 2), (3, 7))):
        master.write(slave, RAM, b"\xff")
        registers = struct.pack("<IHBBHBBB3x", LOGICAL, 1, start_bit, stop_bit, RAM, 0, 1, 1)
        master.write(slave, reg.FMMU, registers)
    reply = master.logical(Command.LRD, LOGICAL, b"\0")
    assert (reply.data, reply.counter) == (b"\xff", 3)
    master.write(1, RAM, b"\xfe")
    assert master.logical(Command.LRD, LOGICAL, b"\0").data == b"\xfb"


def test_an_inactive_or_empty_fmmu_maps_nothing() -> None:
    layout = struct.Struct("<IHBBHBBB3x")
    assert Fmmu.of(layout.pack(0, 1, 0, 7, RAM, 0, 3, 0)) is None
    assert Fmmu.of(layout.pack(0, 0, 0, 7, RAM, 0, 3, 1)) is None
    assert Fmmu.of(layout.pack(0, 1, 5, 2, RAM, 0, 3, 1)) is None


def test_the_status_of_a_mailbox_can_be_mapped() -> None:
    master = master_of(1)
    master.pre_op(0)
    status = reg.SYNC_MANAGER + 8 + 5
    master.write(0, reg.FMMU, struct.pack("<IHBBHBBB3x", LOGICAL, 1, 0, 0, status, 3, 1, 1))
    assert master.logical(Command.LRD, LOGICAL, b"\0").data == b"\0"
    master.line.slaves[0].emergency(0x1000)
    master.line.tick(master.now_ns)
    assert master.logical(Command.LRD, LOGICAL, b"\0").data == b"\1"
    master.write(0, reg.FMMU, struct.pack("<IHBBHBBB3x", LOGICAL, 1, 0, 0, status, 3, 2, 1))
    assert master.logical(Command.LWR, LOGICAL, b"\1").counter == 0  # registers are not written


def test_memory_that_does_not_exist_is_not_mapped() -> None:
    master = master_of(1)
    end = reg.MEMORY_SIZE - 1
    master.write(0, reg.FMMU, struct.pack("<IHBBHBBB3x", LOGICAL, 2, 0, 7, end, 0, 3, 1))
    assert master.logical(Command.LRW, LOGICAL, b"\0\0").counter == 0
