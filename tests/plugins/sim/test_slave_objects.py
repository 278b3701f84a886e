"""Objects (SDO) of the simulated slaves."""

from __future__ import annotations

import pytest
from tests.plugins.sim.harness import Harness, harness

import robotd_sim
from robotd.api import FieldbusDriver, InvalidArgument, OperationError

POSITION, STATUSWORD, WINDOW = 0x6064, 0x6041, 0x6065


def bus_of(made: Harness) -> FieldbusDriver:
    return robotd_sim.robotd_fieldbus(made.device)


def number(bus: FieldbusDriver, node: int, index: int, sub: int = 0) -> int:
    return int.from_bytes(bus.read_object(0, node, index, sub), "little", signed=True)


def test_slaves_have_an_identity_and_drives_their_type() -> None:
    made = harness(2, io_module=True)
    bus = bus_of(made)
    assert [number(bus, node, 0x1000) for node in range(3)] == [0x20192, 0x20192, 0x30191]
    nodes = bus.status(0).nodes
    for sub, name in enumerate(("vendor_id", "product_code", "revision", "serial"), 1):
        assert [number(bus, node.id, 0x1018, sub) for node in nodes] == [
            getattr(node, name) for node in nodes
        ]
    assert bus.read_object(0, 2, 0x1008, 0) == b"simulated module"


def test_values_are_those_of_the_drive() -> None:
    made = harness(2)
    bus = bus_of(made)
    made.axes.servo(0, True, 1.0)
    image = made.look(0.1)
    gain = made.simulation.scaling.gain[0]
    assert number(bus, 0, POSITION) == pytest.approx(image.position[0] * gain, abs=1.0)
    assert number(bus, 0, STATUSWORD) & 0x6F == 0x27  # operation enabled
    assert number(bus, 1, 0x6061) == 8
    made.faults.trip(0, 0x2310)
    made.look(0.05)
    assert number(bus, 0, STATUSWORD) & 0x4F == 0x08  # fault
    assert number(bus, 0, 0x603F) == 0x2310


def test_a_parameter_is_kept_in_its_drive_alone() -> None:
    bus = bus_of(harness(2))
    before = bus.read_object(0, 1, WINDOW, 0)
    bus.write_object(0, 0, WINDOW, 0, (20000).to_bytes(4, "little"))
    assert number(bus, 0, WINDOW) == 20000
    assert bus.read_object(0, 1, WINDOW, 0) == before


@pytest.mark.parametrize(
    ("index", "sub", "size", "reason"),
    [
        (0x5FFF, 0, 4, r"0x5FFF:00: the object does not exist \(SDO abort 0x06020000\)"),
        (0x1018, 9, 4, r"0x1018:09: the subindex does not exist \(SDO abort 0x06090011\)"),
        (0x6064, 0, 4, "read-only"),
        (0x1018, 1, 4, "read-only"),
        (0x6065, 0, 2, "wrong length"),
        (0x607A, 0, 4, "the master commands it in each cycle"),
    ],
)
def test_a_rejected_write_has_an_abort_code(index: int, sub: int, size: int, reason: str) -> None:
    bus = bus_of(harness(2))
    with pytest.raises(OperationError, match=rf"slave 1: writing .*{reason}"):
        bus.write_object(0, 1, index, sub, bytes(size))


def test_a_slave_that_does_not_answer_or_exist_is_named() -> None:
    made = harness(2)
    bus = bus_of(made)
    made.faults.disconnect(1)
    with pytest.raises(OperationError, match="slave 1 on master 0 does not answer"):
        bus.read_object(0, 1, 0x1000, 0)
    with pytest.raises(InvalidArgument, match="slave 2 does not exist"):
        bus.read_object(0, 2, 0x1000, 0)
    with pytest.raises(OperationError, match="reading 0x6064:01: the subindex"):
        bus.read_object(0, 0, POSITION, 1)
