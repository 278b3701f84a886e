"""The independent drive against CiA 301 and CiA 402-2, in simulated time."""

from __future__ import annotations

import ast
import struct
import sys
from pathlib import Path
from typing import Any

import can
import canopen
import pytest
from tests.plugins.independent.canopen_device import Nmt
from tests.plugins.independent.canopen_objects import EXTENDED, INVALID, NO_RTR, Abort
from tests.plugins.independent.cia402_node import ServoDrive, State
from tests.plugins.independent.harness import ThreadedNode, duplicate
from tests.plugins.independent.knobs import Knobs

pytestmark = pytest.mark.daily

NODE = 5
TURN = 65_536


class Bench:
    """Drive with the clock and the frames of the test."""

    def __init__(self, **knobs: Any) -> None:
        self.frames: list[can.Message] = []
        self.drive = ServoDrive(NODE, self.frames.append, Knobs(**knobs))
        self.now = 0.0

    def wait(self, seconds: float) -> None:
        for _ in range(max(round(seconds * 1000), 1)):
            self.now += 1e-3
            self.drive.tick(self.now)

    def send(self, can_id: int, data: bytes = b"", remote: bool = False) -> None:
        self.drive.receive(
            can.Message(
                arbitration_id=can_id, data=data, is_extended_id=False, is_remote_frame=remote
            ),
            self.now,
        )

    def sent(self, can_id: int) -> list[bytes]:
        """Return the data of all frames of one CAN-ID, and forget them."""
        found = [bytes(frame.data) for frame in self.frames if frame.arbitration_id == can_id]
        self.frames[:] = [frame for frame in self.frames if frame.arbitration_id != can_id]
        return found

    def request(self, data: bytes) -> bytes:
        self.send(0x600 + NODE, data.ljust(8, b"\0"))
        [response] = self.sent(0x580 + NODE)
        if response[0] == 0x80:
            raise Abort(int.from_bytes(response[4:], "little"))
        return response

    def write(self, index: int, sub: int, value: int, size: int = 4) -> None:
        data = (value & (1 << 8 * size) - 1).to_bytes(size, "little")
        command = 0x23 | (4 - size) << 2
        assert self.request(struct.pack("<BHB", command, index, sub) + data)[0] == 0x60

    def read(self, index: int, sub: int = 0) -> int:
        response = self.request(struct.pack("<BHB", 0x40, index, sub))
        return int.from_bytes(response[4 : 8 - (response[0] >> 2 & 3)], "little")

    def nmt(self, command: int) -> None:
        self.send(0, bytes([command, NODE]))

    def control(self, *words: int) -> None:
        for word in words:
            self.write(0x6040, 0, word, 2)
            self.wait(0.001)

    def enable(self, mode: int) -> None:
        self.write(0x6060, 0, mode, 1)
        self.control(0x06, 0x07, 0x0F)
        assert self.drive.power is State.ENABLED


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.wait(0.1)
    return bench


def abort_of(bench: Bench, data: bytes) -> int:
    with pytest.raises(Abort) as aborted:
        bench.request(data)
    return aborted.value.code


def rejected(bench: Bench, index: int, sub: int, value: int, size: int = 4) -> int:
    with pytest.raises(Abort) as aborted:
        bench.write(index, sub, value, size)
    return aborted.value.code


# NMT, heartbeat, EMCY


def test_boots_into_pre_operational_and_announces_it_once() -> None:
    bench = Bench(boot_s=0.05)
    bench.send(0x600 + NODE, struct.pack("<BHB4x", 0x40, 0x1000, 0))
    bench.wait(0.04)
    assert not bench.frames
    bench.wait(0.1)
    assert bench.sent(0x700 + NODE) == [b"\0"]
    assert bench.drive.state is Nmt.PRE_OPERATIONAL


@pytest.mark.parametrize(
    ("command", "state"),
    [(0x01, Nmt.OPERATIONAL), (0x02, Nmt.STOPPED), (0x80, Nmt.PRE_OPERATIONAL)],
)
def test_obeys_nmt_commands(bench: Bench, command: int, state: Nmt) -> None:
    bench.nmt(command)
    assert bench.drive.state is state
    bench.send(0, bytes([0x80, NODE + 1]))
    assert bench.drive.state is state
    bench.send(0, bytes([0x80, 0]))
    assert bench.drive.state is Nmt.PRE_OPERATIONAL


def test_stopped_node_answers_no_sdo(bench: Bench) -> None:
    bench.nmt(2)
    bench.send(0x600 + NODE, struct.pack("<BHB4x", 0x40, 0x1000, 0))
    assert not bench.sent(0x580 + NODE)


@pytest.mark.parametrize(("command", "offset"), [(0x81, 0), (0x82, 100)])
def test_reset_communication_keeps_the_application(bench: Bench, command: int, offset: int) -> None:
    bench.write(0x607C, 0, 100)
    bench.write(0x1017, 0, 500, 2)
    bench.sent(0x700 + NODE)
    bench.nmt(command)
    bench.wait(0.1)
    assert bench.sent(0x700 + NODE) == [b"\0"]
    assert bench.read(0x1017) == 0
    assert bench.read(0x607C) == offset


def test_heartbeat_tells_the_state_each_period(bench: Bench) -> None:
    bench.sent(0x700 + NODE)
    bench.write(0x1017, 0, 100, 2)
    bench.wait(0.45)
    assert bench.sent(0x700 + NODE) == [b"\x7f"] * 5  # the first one at once
    bench.nmt(1)
    bench.drive.knobs.heartbeat_copies = 2
    bench.wait(0.5)
    assert bench.sent(0x700 + NODE) == [b"\x05"] * 10


def test_lost_heartbeat_after_the_first_one_is_a_fault(bench: Bench) -> None:
    bench.write(0x1016, 1, 0x7F << 16 | 200)
    bench.nmt(1)
    bench.enable(9)
    bench.wait(0.5)
    assert bench.drive.state is Nmt.OPERATIONAL
    bench.send(0x77F, b"\x05")
    bench.wait(0.19)
    assert bench.drive.power is State.ENABLED
    bench.wait(0.1)
    assert bench.drive.state is Nmt.PRE_OPERATIONAL
    assert bench.drive.power is State.FAULT
    assert struct.unpack("<HB5x", bench.sent(0x80 + NODE)[0])[0] == 0x8130


def test_one_node_is_consumed_once(bench: Bench) -> None:
    bench.write(0x1016, 1, 0x7F << 16 | 200)
    assert rejected(bench, 0x1016, 2, 0x7F << 16 | 300) == 0x0604_0043


def test_error_history_has_the_newest_first_and_can_be_cleared(bench: Bench) -> None:
    bench.drive.fault(0x3210, 4)
    bench.drive.emergency(0x4210, 8)
    assert bench.read(0x1003) == 2
    assert [bench.read(0x1003, sub) for sub in (1, 2)] == [0x4210, 0x3210]
    assert bench.read(0x1001) == 0x0D
    assert rejected(bench, 0x1003, 0, 1, 1) == 0x0609_0030
    bench.write(0x1003, 0, 0, 1)
    assert bench.read(0x1003) == 0


# SDO


@pytest.mark.parametrize(
    ("request_bytes", "code"),
    [
        (struct.pack("<BHB", 0x40, 0x5555, 0), 0x0602_0000),
        (struct.pack("<BHB", 0x40, 0x1018, 9), 0x0609_0011),
        (struct.pack("<BHBI", 0x23, 0x1000, 0, 1), 0x0601_0002),
        (struct.pack("<BHBI", 0x2B, 0x607C, 0, 1), 0x0607_0013),
        (struct.pack("<BHBI", 0x23, 0x6040, 0, 1), 0x0607_0012),
        (struct.pack("<BHBI", 0x2F, 0x6060, 0, 5), 0x0609_0030),
        (struct.pack("<BHBI", 0x2F, 0x6098, 0, 17), 0x0609_0030),
        (struct.pack("<BHBI", 0x23, 0x1010, 1, 1), 0x0800_0020),
        (b"\x60", 0x0504_0001),
        (b"\x00", 0x0504_0001),
        (struct.pack("<BHBI", 0xC2, 0x2000, 0, 4), 0x0504_0001),
    ],
    ids=lambda value: f"{value:08X}" if isinstance(value, int) else value.hex(),
)
def test_sdo_aborts(bench: Bench, request_bytes: bytes, code: int) -> None:
    assert abort_of(bench, request_bytes) == code


def test_segmented_upload_and_its_toggle_bit(bench: Bench) -> None:
    text = "a text that needs segments"
    upload = struct.pack("<BHB", 0x40, 0x2000, 0)
    assert bench.request(upload) == struct.pack("<BHBI", 0x41, 0x2000, 0, len(text))
    received, command = b"", 0x60
    while True:
        response = bench.request(bytes([command]))
        assert response[0] & 0x10 == command & 0x10
        received += response[1 : 8 - (response[0] >> 1 & 7)]
        if response[0] & 1:
            break
        command ^= 0x10
    assert received.decode() == text
    assert abort_of(bench, b"\x60") == 0x0504_0001
    bench.request(upload)
    bench.request(b"\x60")
    assert abort_of(bench, b"\x60") == 0x0503_0000


def test_segmented_download_and_its_announced_size(bench: Bench) -> None:
    download = struct.pack("<BHBI", 0x21, 0x2000, 0, 9)
    assert bench.request(download)[0] == 0x60
    assert bench.request(b"\x00abcdefg")[0] == 0x20
    assert bench.request(b"\x1bhi")[0] == 0x30
    assert bench.drive.objects[0x2000, 0].value == "abcdefghi"
    bench.request(download)
    assert abort_of(bench, b"\x01abcdefg") == 0x0607_0010


def test_empty_string_is_an_upload_of_no_bytes() -> None:
    bench = Bench(empty_strings=True)
    bench.wait(0.1)
    assert bench.request(struct.pack("<BHB", 0x40, 0x1008, 0))[4:] == b"\0\0\0\0"
    assert bench.request(b"\x60")[0] == 0x0F


def test_store_is_counted_and_survives_a_reset(bench: Bench) -> None:
    bench.drive.knobs.store_s = 3.0
    bench.write(0x607C, 0, 77)
    bench.send(0x600 + NODE, struct.pack("<BHBI", 0x23, 0x1010, 1, 0x65766173))
    bench.wait(2.9)
    assert not bench.sent(0x580 + NODE)
    bench.wait(0.2)
    assert bench.sent(0x580 + NODE)[0][0] == 0x60
    assert bench.drive.counts["stores"] == 1
    bench.nmt(0x81)
    bench.wait(0.1)
    assert bench.read(0x607C) == 77
    bench.write(0x1011, 1, 0x64616F6C)
    assert bench.read(0x607C) == 77
    bench.nmt(0x81)
    bench.wait(0.1)
    assert bench.read(0x607C) == 0


# Parameters of PDOs


def test_mapping_needs_an_invalid_pdo_and_no_mapped_objects(bench: Bench) -> None:
    position = 0x6064_0020
    assert rejected(bench, 0x1A00, 0, 0, 1) == 0x0601_0000
    bench.write(0x1800, 1, INVALID | 0x180 + NODE)
    assert rejected(bench, 0x1A00, 1, position) == 0x0601_0000
    bench.write(0x1A00, 0, 0, 1)
    bench.write(0x1A00, 1, position)
    bench.write(0x1A00, 2, 0x606C_0020)
    bench.write(0x1A00, 0, 2, 1)
    bench.write(0x1800, 1, 0x180 + NODE)
    assert rejected(bench, 0x1A00, 0, 1, 1) == 0x0601_0000
    bench.nmt(1)
    bench.wait(0.01)
    assert bench.sent(0x180 + NODE)[-1] == struct.pack("<ii", 123_456, 0)


@pytest.mark.parametrize(
    ("word", "code"),
    [
        (0x5555_0020, 0x0602_0000),
        (0x6064_0120, 0x0602_0000),
        (0x6064_0010, 0x0604_0041),
        (0x607A_0020, 0x0604_0041),
        (0x1017_0010, 0x0604_0041),
        (0x0007_0020, 0x0604_0041),
    ],
)
def test_tpdo_rejects_objects(bench: Bench, word: int, code: int) -> None:
    bench.write(0x1A01, 0, 0, 1)
    expected = 0x0602_0000 if word >> 16 == 7 else code
    assert rejected(bench, 0x1A01, 1, word) == expected


def test_rpdo_skips_dummy_objects(bench: Bench) -> None:
    bench.write(0x1601, 0, 0, 1)
    assert rejected(bench, 0x1601, 1, 0x6064_0020) == 0x0604_0041
    bench.write(0x1601, 1, 0x0005_0008)
    bench.write(0x1601, 2, 0x60FF_0020)
    bench.write(0x1601, 0, 2, 1)
    bench.write(0x1401, 1, 0x300 + NODE)
    bench.nmt(1)
    bench.send(0x300 + NODE, struct.pack("<Bi", 9, -7))
    assert bench.drive[0x60FF] == -7


def test_pdo_has_64_bits(bench: Bench) -> None:
    bench.write(0x1A01, 0, 0, 1)
    for sub, word in enumerate((0x6064_0020, 0x606C_0020, 0x6041_0010), 1):
        bench.write(0x1A01, sub, word)
    assert rejected(bench, 0x1A01, 0, 3, 1) == 0x0604_0042
    assert rejected(bench, 0x1A01, 0, 9, 1) == 0x0604_0042
    bench.write(0x1A01, 0, 2, 1)


@pytest.mark.parametrize("value", [0x600 + NODE, 0x7E5, 0x20, EXTENDED | 0x185, 0x281])
def test_cob_id_of_a_valid_pdo_is_fixed_and_not_restricted(bench: Bench, value: int) -> None:
    assert rejected(bench, 0x1800, 1, value) == 0x0609_0030
    bench.write(0x1800, 1, INVALID | NO_RTR | 0x281)


@pytest.mark.parametrize(
    ("index", "kind", "allowed"),
    [
        *((0x1801, kind, True) for kind in (0, 1, 240, 252, 253, 254, 255)),
        *((0x1801, kind, False) for kind in (241, 251)),
        *((0x1401, kind, True) for kind in (0, 240, 254, 255)),
        *((0x1401, kind, False) for kind in (241, 252, 253)),
    ],
)
def test_transmission_types(bench: Bench, index: int, kind: int, allowed: bool) -> None:
    if allowed:
        bench.write(index, 2, kind, 1)
    else:
        assert rejected(bench, index, 2, kind, 1) == 0x0609_0030


def test_inhibit_time_is_fixed_while_the_pdo_is_valid(bench: Bench) -> None:
    assert rejected(bench, 0x1800, 3, 10, 2) == 0x0609_0030
    bench.write(0x1801, 3, 10, 2)


# Transmission of PDOs


def velocity_tpdo(bench: Bench, kind: int, inhibit: int = 0, timer: int = 0) -> int:
    """Map the velocity into TPDO 2, start the node in csv and return the CAN-ID."""
    bench.write(0x1A01, 0, 0, 1)
    bench.write(0x1A01, 1, 0x606C_0020)
    bench.write(0x1A01, 0, 1, 1)
    bench.write(0x1801, 2, kind, 1)
    bench.write(0x1801, 3, inhibit, 2)
    bench.write(0x1801, 5, timer, 2)
    bench.write(0x1801, 1, 0x280 + NODE)
    bench.nmt(1)
    bench.enable(9)
    bench.wait(0.01)
    return 0x280 + NODE


def test_synchronous_tpdo_comes_with_each_nth_sync(bench: Bench) -> None:
    can_id = velocity_tpdo(bench, 3)
    for _ in range(9):
        bench.send(0x80)
        bench.wait(0.002)
    assert len(bench.sent(can_id)) == 3


def test_acyclic_synchronous_tpdo_comes_with_the_sync_after_a_change(bench: Bench) -> None:
    can_id = velocity_tpdo(bench, 0)
    bench.send(0x80)
    bench.send(0x80)
    assert len(bench.sent(can_id)) == 1
    bench.write(0x60FF, 0, TURN)
    bench.wait(0.01)
    assert not bench.sent(can_id)
    bench.send(0x80)
    assert len(bench.sent(can_id)) == 1


def test_remote_frames_sample_at_the_sync_or_at_the_request(bench: Bench) -> None:
    can_id = velocity_tpdo(bench, 252)
    bench.send(can_id, remote=True)
    assert not bench.sent(can_id)
    bench.send(0x80)
    bench.write(0x60FF, 0, TURN)
    bench.wait(0.1)
    bench.send(can_id, remote=True)
    assert bench.sent(can_id) == [struct.pack("<i", 0)]
    bench.write(0x1801, 2, 253, 1)
    bench.send(can_id, remote=True)
    assert bench.sent(can_id) == [struct.pack("<i", TURN)]
    bench.write(0x1801, 1, INVALID | can_id)
    bench.write(0x1801, 1, NO_RTR | can_id)
    bench.send(can_id, remote=True)
    assert not bench.sent(can_id)


def test_event_driven_tpdo_has_inhibit_time_and_event_timer(bench: Bench) -> None:
    can_id = velocity_tpdo(bench, 255, inhibit=200, timer=100)
    assert len(bench.sent(can_id)) == 1
    bench.wait(0.5)
    assert len(bench.sent(can_id)) == 5
    bench.write(0x6083, 0, TURN)
    bench.write(0x6060, 0, 3, 1)
    bench.write(0x60FF, 0, TURN)
    bench.wait(0.2)
    assert 9 <= len(bench.sent(can_id)) <= 10


def test_silent_event_driven_position_is_sent_on_change_only() -> None:
    bench = Bench(event_position=True, position_alone=True)
    bench.wait(0.1)
    assert rejected(bench, 0x1802, 5, 100, 2) == 0x0609_0011
    bench.nmt(1)
    bench.wait(1.0)
    assert not bench.sent(0x380 + NODE)
    bench.enable(9)
    assert bench.drive.counts["enabled_blind"] == 1
    bench.write(0x60FF, 0, TURN)
    bench.wait(0.1)
    assert bench.sent(0x380 + NODE)


def test_mapping_may_be_constant() -> None:
    bench = Bench(fixed_mapping=True)
    bench.wait(0.1)
    bench.write(0x1800, 1, INVALID | 0x180 + NODE)
    for index, sub, size in ((0x1A00, 0, 1), (0x1A00, 1, 4), (0x1600, 0, 1)):
        assert rejected(bench, index, sub, 1, size) == 0x0601_0002
    bench.write(0x1800, 2, 1, 1)


def test_position_tpdo_of_its_own() -> None:
    bench = Bench(position_alone=True, self_starting=True)
    bench.wait(0.1)
    assert bench.drive.state is Nmt.OPERATIONAL
    assert bench.sent(0x380 + NODE) == [struct.pack("<i", 123_456)]


def test_synchronous_rpdo_acts_at_the_next_sync(bench: Bench) -> None:
    bench.write(0x1400, 2, 1, 1)
    bench.nmt(1)
    bench.send(0x200 + NODE, b"\x06\x00")
    bench.wait(0.01)
    assert bench.drive.power is State.SWITCH_ON_DISABLED
    bench.send(0x80)
    assert bench.drive.power is State.READY


def test_synchronous_rpdos_act_together(bench: Bench) -> None:
    bench.write(0x1400, 2, 1, 1)
    bench.write(0x1402, 2, 1, 1)
    bench.write(0x1402, 1, 0x400 + NODE)
    bench.nmt(1)
    bench.enable(1)
    bench.send(0x200 + NODE, b"\x1f\x00")
    bench.send(0x400 + NODE, struct.pack("<Hi", 0x1F, 130_000))
    bench.send(0x80)
    bench.wait(2.0)
    assert bench.read(0x6064) == 130_000


def test_short_rpdo_is_an_emergency_and_changes_nothing(bench: Bench) -> None:
    bench.nmt(1)
    bench.send(0x200 + NODE, b"\x06")
    assert bench.drive.power is State.SWITCH_ON_DISABLED
    assert struct.unpack_from("<H", bench.sent(0x80 + NODE)[0])[0] == 0x8210


def test_no_pdos_outside_operational(bench: Bench) -> None:
    bench.send(0x200 + NODE, b"\x06\x00")
    bench.wait(0.1)
    assert bench.drive.power is State.SWITCH_ON_DISABLED
    assert not bench.sent(0x180 + NODE)


# CiA 402: states


WALKS = [  # controlwords, then state and statusword & 0x6F
    ((), State.SWITCH_ON_DISABLED),
    ((0x07,), State.SWITCH_ON_DISABLED),
    ((0x0F,), State.SWITCH_ON_DISABLED),
    ((0x06,), State.READY),
    ((0x06, 0x07), State.SWITCHED_ON),
    ((0x06, 0x0F), State.ENABLED),
    ((0x06, 0x07, 0x0F), State.ENABLED),
    ((0x06, 0x00), State.SWITCH_ON_DISABLED),
    ((0x06, 0x02), State.SWITCH_ON_DISABLED),
    ((0x06, 0x07, 0x06), State.READY),
    ((0x06, 0x07, 0x00), State.SWITCH_ON_DISABLED),
    ((0x06, 0x07, 0x02), State.SWITCH_ON_DISABLED),
    ((0x06, 0x0F, 0x07), State.SWITCHED_ON),
    ((0x06, 0x0F, 0x06), State.READY),
    ((0x06, 0x0F, 0x00), State.SWITCH_ON_DISABLED),
    ((0x06, 0x0F, 0x02), State.SWITCH_ON_DISABLED),
    ((0x06, 0x86), State.READY),
]


@pytest.mark.parametrize(("words", "state"), WALKS)
def test_transitions(bench: Bench, words: tuple[int, ...], state: State) -> None:
    bench.control(*words)
    bench.wait(0.01)
    assert bench.drive.power is state
    mask = 0x4F if state in {State.SWITCH_ON_DISABLED, State.FAULT} else 0x6F
    assert bench.read(0x6041) & mask == state & mask


def moving(bench: Bench, speed: int = TURN) -> None:
    bench.enable(9)
    bench.write(0x60FF, 0, speed)
    bench.wait(0.1)
    assert bench.drive.axis.velocity == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize(
    ("option", "seconds", "after"),
    [
        (1, 0.1, State.SWITCH_ON_DISABLED),
        (2, 0.025, State.SWITCH_ON_DISABLED),
        (5, 0.1, State.QUICK_STOP),
        (6, 0.025, State.QUICK_STOP),
    ],
)
def test_quick_stop_options(bench: Bench, option: int, seconds: float, after: State) -> None:
    bench.write(0x605A, 0, option, 2)
    moving(bench)
    bench.control(0x02)
    bench.wait(seconds - 0.01)
    assert bench.drive.power is State.QUICK_STOP
    assert bench.drive.axis.velocity > 0
    bench.wait(0.02)
    assert bench.drive.power is after
    assert bench.drive.axis.velocity == 0
    bench.control(0x0F)
    assert (bench.drive.power is State.ENABLED) == (option >= 5)


def test_disable_voltage_coasts_at_once(bench: Bench) -> None:
    moving(bench)
    bench.control(0x00)
    assert bench.drive.power is State.SWITCH_ON_DISABLED
    assert bench.drive.axis.velocity > 0


def test_disable_operation_ramps_first(bench: Bench) -> None:
    moving(bench)
    bench.control(0x07)
    bench.wait(0.05)
    assert bench.drive.power is State.ENABLED
    bench.wait(0.1)
    assert bench.drive.power is State.SWITCHED_ON


def test_halt_stops_and_stays_enabled(bench: Bench) -> None:
    moving(bench)
    bench.control(0x10F)
    bench.wait(0.2)
    assert bench.drive.power is State.ENABLED
    assert bench.drive.axis.velocity == 0
    assert bench.read(0x6041) & 0x400
    bench.control(0x0F)
    bench.wait(0.1)
    assert bench.drive.axis.velocity > 0


def test_fault_ramps_and_needs_a_rising_edge_to_be_reset(bench: Bench) -> None:
    moving(bench)
    bench.write(0x6040, 0, 0x8F, 2)
    bench.drive.fault(0x3210)
    assert bench.drive.power is State.FAULT_REACTION
    bench.wait(0.1)
    assert bench.drive.power is State.FAULT
    assert bench.read(0x603F) == 0x3210
    bench.control(0x8F)
    assert bench.drive.power is State.FAULT
    bench.control(0x0F, 0x8F)
    assert bench.drive.power is State.SWITCH_ON_DISABLED
    assert bench.read(0x603F) == 0
    codes = [struct.unpack_from("<H", data)[0] for data in bench.sent(0x80 + NODE)]
    assert codes == [0x3210, 0]


def test_fault_code_may_be_in_the_emergency_only(bench: Bench) -> None:
    bench.drive.knobs.code_in_603f = False
    bench.drive.fault(0x3210)
    assert bench.read(0x603F) == 0
    assert struct.unpack_from("<H", bench.sent(0x80 + NODE)[0])[0] == 0x3210


@pytest.mark.parametrize(
    ("option", "state"),
    [
        (0, State.ENABLED),
        (1, State.FAULT),
        (2, State.SWITCH_ON_DISABLED),
        (3, State.SWITCH_ON_DISABLED),
    ],
)
def test_abort_connection_when_the_node_is_stopped(bench: Bench, option: int, state: State) -> None:
    bench.write(0x6007, 0, option, 2)
    bench.nmt(1)
    moving(bench)
    bench.nmt(2)
    bench.wait(0.2)
    assert bench.drive.power is state


def test_statusword_may_be_late(bench: Bench) -> None:
    bench.drive.knobs.status_delay_s = 0.2
    bench.wait(0.3)
    bench.control(0x06)
    assert bench.read(0x6041) & 0x4F == State.SWITCH_ON_DISABLED
    bench.wait(0.25)
    assert bench.read(0x6041) & 0x6F == State.READY


# CiA 402: modes


def test_csp_follows_interpolated_targets(bench: Bench) -> None:
    bench.write(0x607A, 0, 123_456)
    bench.enable(8)
    for step in range(1, 101):
        bench.write(0x607A, 0, 123_456 + 100 * step)
        bench.wait(0.002)
    assert bench.drive.axis.max_step == 100
    assert bench.drive.axis.velocity == pytest.approx(50_000, rel=0.02)
    bench.wait(0.1)
    assert bench.read(0x6064) == 123_456 + 10_000


def test_csp_jumps_to_a_distant_target_at_its_highest_speed(bench: Bench) -> None:
    bench.enable(8)  # 0x607A still has its value of power-on, 0
    bench.wait(1.0)
    assert abs(bench.drive.axis.position) < 1
    assert bench.drive.axis.max_step == 123_456
    assert bench.drive.axis.max_velocity == bench.drive.knobs.max_speed


def test_following_error_is_a_fault(bench: Bench) -> None:
    bench.write(0x6065, 0, 1000)
    bench.write(0x6066, 0, 10, 2)
    bench.enable(8)
    bench.wait(0.3)
    assert bench.drive.power is State.FAULT
    assert bench.read(0x603F) == 0x8611


def test_csv_and_pv_reach_their_speed(bench: Bench) -> None:
    for mode in (9, 3):
        moving(bench, 50_000)
        bench.write(0x6060, 0, mode, 1)
        bench.wait(0.2)
        assert bench.drive[0x606C] == pytest.approx(50_000, rel=0.01)
    assert bench.read(0x6041) & 0x1400 == 0x400
    bench.write(0x60FF, 0, 0)
    bench.wait(0.2)
    assert bench.read(0x6041) & 0x1400 == 0x1400


def test_cst_accelerates_and_limits_the_torque(bench: Bench) -> None:
    bench.write(0x6072, 0, 50, 2)
    bench.enable(10)
    bench.write(0x6071, 0, 100, 2)
    bench.wait(5.0)
    assert bench.read(0x6077) == 50
    assert bench.drive.axis.velocity == pytest.approx(50 / 10 / 2 * TURN, rel=0.01)


def test_profile_position_handshake_and_buffer(bench: Bench) -> None:
    bench.enable(1)
    for target in (200_000, 150_000):
        bench.write(0x607A, 0, target)
        bench.control(0x1F)
        assert bench.read(0x6041) & 0x1400 == 0x1000
        bench.control(0x0F)
        bench.wait(0.01)
        buffered = target == 150_000
        assert bool(bench.read(0x6041) & 0x1000) == buffered
    bench.wait(5.0)
    assert bench.read(0x6064) == 150_000
    assert bench.read(0x6041) & 0x1400 == 0x400
    assert bench.drive.axis.max_velocity <= TURN
    bench.write(0x607A, 0, -50_000)
    bench.control(0x7F)
    bench.control(0x0F)
    bench.wait(3.0)
    assert bench.read(0x6064) == 100_000


def test_profile_position_takes_the_target_of_the_same_pdo(bench: Bench) -> None:
    bench.write(0x1400, 1, INVALID | 0x200 + NODE)
    bench.write(0x1600, 0, 0, 1)
    bench.write(0x1600, 1, 0x6040_0010)
    bench.write(0x1600, 2, 0x607A_0020)
    bench.write(0x1600, 0, 2, 1)
    bench.write(0x1400, 1, 0x200 + NODE)
    bench.nmt(1)
    bench.enable(1)
    bench.send(0x200 + NODE, struct.pack("<Hi", 0x1F, 130_000))
    bench.send(0x200 + NODE, struct.pack("<Hi", 0x0F, 140_000))
    bench.wait(2.0)
    assert bench.read(0x6064) == 130_000


@pytest.mark.parametrize(("method", "home"), [(33, TURN), (34, 2 * TURN), (35, None), (37, None)])
def test_homing(bench: Bench, method: int, home: int | None) -> None:
    bench.write(0x6098, 0, method, 1)
    bench.write(0x607C, 0, 500)
    bench.enable(6)
    assert bench.read(0x6041) & 0x3400 == 0x400
    bench.control(0x1F)
    bench.wait(0.1 if home is None else 0.3)
    assert bool(bench.read(0x6041) & 0x1000) == (home is None)
    bench.wait(4.0)
    assert bench.read(0x6041) & 0x3400 == 0x1400
    axis = bench.drive.axis
    assert axis.counts_at_zero == (123_456 if home is None else home) - 500
    assert bench.drive[0x6064] == round(axis.position - axis.counts_at_zero)


def test_position_uses_the_factor_group() -> None:
    bench = Bench(power_on_position=3 * TURN, feed=3600)
    bench.wait(0.1)
    assert bench.read(0x6064) == 3 * 3600
    bench.write(0x6091, 1, 4)
    bench.wait(0.01)
    assert bench.read(0x6064) == 3 * 900


# Knobs


def test_responses_may_be_slow_missing_or_double() -> None:
    bench = Bench(sdo_delay_s=0.2, sdo_missing=1)
    bench.wait(0.1)
    request = struct.pack("<BHB4x", 0x40, 0x1000, 0)
    bench.send(0x600 + NODE, request)
    bench.wait(0.3)
    assert not bench.sent(0x580 + NODE)
    bench.send(0x600 + NODE, request)
    bench.wait(0.19)
    assert not bench.sent(0x580 + NODE)
    bench.wait(0.05)
    assert len(bench.sent(0x580 + NODE)) == 1
    bench.drive.knobs.duplicate_delay_s = 0.5
    twin = duplicate(bench.drive)
    twin.tick(bench.now + 0.1)
    assert twin.state is Nmt.PRE_OPERATIONAL
    assert twin[0x6064] == -5
    assert twin.answer_delay_s(0x1000, 0, False) == 0.5


def test_objects_may_be_rejected_or_absent() -> None:
    for rejection, code in (("ro", 0x0601_0002), ("abort", 0x0800_0022)):
        bench = Bench(rejected=(0x6007, 0x605A), rejection=rejection, absent=(0x6084, 0x6502))
        bench.wait(0.1)
        assert rejected(bench, 0x605A, 0, 6, 2) == code
        assert bench.read(0x605A) == 2
        with pytest.raises(Abort, match="0x06020000"):
            bench.read(0x6502)
        assert "[6084]" not in bench.drive.eds(NODE)
        assert bench.drive.writes["605A:0"] == 1


def test_restart_coasts_and_keeps_the_position(bench: Bench) -> None:
    bench.nmt(1)
    moving(bench)
    bench.sent(0x700 + NODE)
    bench.drive.restart()
    bench.wait(0.5)
    assert bench.sent(0x700 + NODE) == [b"\0"]
    assert bench.drive.state is Nmt.PRE_OPERATIONAL
    assert bench.drive.power is State.SWITCH_ON_DISABLED
    assert bench.drive.axis.position > 123_456


def test_shares_no_code_with_robotd() -> None:
    folder = Path(__file__).parent
    names = ("canopen_objects", "canopen_device", "servo_axis", "cia402_node", "knobs", "harness")
    for name in names:
        tree = ast.parse((folder / f"{name}.py").read_text(encoding="utf-8"))
        imported = [n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
        imported += [a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names]
        roots = {module.split(".")[0] for module in imported} - sys.stdlib_module_names
        assert roots <= {"can", "tests"}
        assert all(
            m.startswith("tests.plugins.independent") for m in imported if m.startswith("tests")
        )


def test_eds_describes_the_drive(tmp_path: Path) -> None:
    drive = Bench().drive
    path = tmp_path / "node.eds"
    path.write_text(drive.eds(NODE))
    dictionary = canopen.import_od(str(path), NODE)
    for (index, sub), entry in drive.objects.items():
        variable = dictionary.get_variable(index, sub)
        assert variable is not None
        assert variable.default == entry.default
        assert variable.access_type == entry.access
        assert variable.pdo_mappable == bool(entry.pdo)


def test_runs_in_a_thread_with_a_foreign_master() -> None:
    bus = can.Bus(interface="virtual", channel="independent-drive")
    network = canopen.Network()
    network.connect(interface="virtual", channel="independent-drive")
    with ThreadedNode(bus, NODE) as node:
        assert node["nmt"] == "PRE_OPERATIONAL"
        remote = network.add_node(NODE, canopen.ObjectDictionary())
        assert remote.sdo.upload(0x2000, 0) == b"a text that needs segments"
        remote.sdo.download(0x2000, 0, b"another text that needs them")
        assert remote.sdo.upload(0x2000, 0) == b"another text that needs them"
        node.set(heartbeat_copies=2)
        node.do("fault", code=0x3210)
        assert node["emergencies"] == [0x3210]
    network.disconnect()
