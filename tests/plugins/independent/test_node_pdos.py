"""The independent drive against CiA 301, in simulated time: parameters and transmission of PDOs."""

from __future__ import annotations

import struct

import pytest
from tests.plugins.independent.canopen_device import Nmt
from tests.plugins.independent.canopen_objects import EXTENDED, INVALID, NO_RTR
from tests.plugins.independent.cia402_node import State
from tests.plugins.independent.node_bench import NODE, TURN, Bench, booted, rejected

pytestmark = pytest.mark.daily


@pytest.fixture
def bench() -> Bench:
    return booted()


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
