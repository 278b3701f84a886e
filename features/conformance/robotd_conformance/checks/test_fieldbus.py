"""Fieldbus answers: there in every state, consistent, and without side effects."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from robotd.api import (
    BusState,
    BusStatus,
    Capability,
    DeviceDriver,
    FaultInjector,
    FieldbusDriver,
    OperationError,
)
from robotd_conformance.checks.harness import SETTLED_RAD, Harness, MakeHarness

pytestmark = pytest.mark.needs(Capability.FIELDBUS)

DEVICE_TYPE, IDENTITY = 0x1000, 0x1018  # objects that CiA 301 and CoE ask of every node
ABORT_CODE = r"0[xX]0?[56]0[0-9A-Fa-f]{5}|0[xX]0?80000[0-9A-Fa-f]{2}"  # of SDO (CiA 301)
LOST = 3  # frames
BYTE = 256  # where a counter of 8 bits begins anew
RESERVED = 0x0FFF  # no object can have this index
HARMLESS = (0x6068, 0x6066, 0x6067)  # of CiA 402: window and time-outs of the drive's own messages


def fieldbus_of(harness: Harness) -> FieldbusDriver:
    driver = harness.drivers.fieldbus
    if driver is None:
        pytest.skip(f"the robot {harness.robot.descriptor.name} has no fieldbus on this backend")
    return driver


@pytest.mark.clause("FieldbusDriver.status/states", "FieldbusDriver.buses/number")
def test_it_answers_in_every_state(unopened: Harness) -> None:
    driver, device = fieldbus_of(unopened), unopened.drivers.device
    assert driver.buses >= 1
    unopened.begin()
    calls: list[Callable[[], object]] = [
        device.state,
        unopened.open,
        lambda: device.start_communication(10.0),
        lambda: device.stop_communication(10.0),
        device.close,
    ]
    for call in calls:
        call()
        for master in range(driver.buses):
            assert isinstance(driver.status(master), BusStatus)


@pytest.mark.clause("FieldbusDriver.status/status", "FieldbusDriver.node_ids/ids")
def test_the_slaves_are_told_apart(harness: Harness) -> None:
    driver = fieldbus_of(harness)
    for master in range(driver.buses):
        network = driver.status(master)
        ids = [node.id for node in network.nodes]
        assert len(ids) == len(set(ids))
        assert sorted(driver.node_ids(master)) == sorted(ids), "node_ids differ from the status"
        assert {type(node.state) for node in network.nodes} <= {BusState}


@pytest.mark.clause("FieldbusDriver.status/status")
def test_the_drives_are_operational(harness: Harness) -> None:
    driver = fieldbus_of(harness)
    networks = [driver.status(master) for master in range(driver.buses)]
    assert sum(network.axes for network in networks) >= harness.count
    drives = [node for network in networks for node in network.nodes if node.axes]
    assert all(node.state is BusState.OPERATIONAL and not node.offline for node in drives)
    assert not any(node.fault for node in drives)


@pytest.mark.clause("FieldbusDriver.status/status")
def test_what_is_told_of_it_is_text(harness: Harness) -> None:
    driver = fieldbus_of(harness)
    for network in map(driver.status, range(driver.buses)):
        texts = [
            *network.details,
            *network.details.values(),
            *(node.fault for node in network.nodes),
        ]
        assert {type(text) for text in texts} <= {str}
        assert not any("\n" in text for text in texts)


@pytest.mark.clause("FieldbusDriver.status/status")
def test_a_lost_slave_is_shown(fresh: Harness) -> None:
    driver = fieldbus_of(fresh)
    fresh.injector.disconnect(0)

    def lost() -> bool:
        nodes = [node for bus in range(driver.buses) for node in driver.status(bus).nodes]
        return any(node.offline or node.state is not BusState.OPERATIONAL for node in nodes)

    fresh.until(lost, "a slave is offline or not operational", 3.0)


@pytest.mark.clause("FieldbusDriver.register_bytes/size")
@pytest.mark.clause("FieldbusDriver.read_register/memory")
@pytest.mark.needs(Capability.REGISTER_READ)
def test_registers_have_the_length_that_was_asked_for(harness: Harness) -> None:
    slave = fieldbus_of(harness).status(0).nodes[0].id
    for length in (1, 2, 4, 16):
        assert len(harness.robot.fieldbus.read_register(0, slave, 0x0000, length)) == length
    size = fieldbus_of(harness).register_bytes
    assert len(harness.robot.fieldbus.read_register(0, slave, size - 4, 4)) == 4
    whole = harness.robot.fieldbus.read_register(0, slave, 0x0000, 8)
    assert harness.robot.fieldbus.read_register(0, slave, 0x0004, 4) == whole[4:]


@pytest.mark.clause("FieldbusDriver.reset_statistics/zero")
@pytest.mark.needs(Capability.STATISTICS)
def test_counters_are_zero_after_a_reset(harness: Harness) -> None:
    harness.robot.fieldbus.reset_statistics(0)
    network = harness.robot.fieldbus.status(0)
    assert (network.lost_frames, network.timeouts, network.late_cycles) == (0, 0, 0)


@pytest.mark.clause("FieldbusDriver.start_hot_connect/joins")
@pytest.mark.needs(Capability.HOT_CONNECT)
def test_a_hot_connect_moves_and_switches_nothing(harness: Harness) -> None:
    start = harness.image.position.copy()
    harness.robot.fieldbus.start_hot_connect(0)
    harness.pass_time(0.5)
    assert harness.image.servo_on.all()
    assert np.abs(harness.image.position - start).max() <= SETTLED_RAD


@pytest.mark.clause("FieldbusDriver.status/states")
def test_a_bus_that_exchanges_nothing_is_not_operational(unopened: Harness) -> None:
    driver = fieldbus_of(unopened)
    unopened.begin()
    for _ in range(2):  # connections
        unopened.open()
        assert driver.status(0).state is not BusState.OPERATIONAL
        unopened.drivers.device.start_communication(10.0)
        assert driver.status(0).state is BusState.OPERATIONAL
        unopened.drivers.device.stop_communication(10.0)
        assert driver.status(0).state is not BusState.OPERATIONAL
        unopened.robot.connection.close()


@pytest.mark.clause("FieldbusDriver.status/status")
def test_the_nodes_have_as_many_axes_as_the_bus(harness: Harness) -> None:
    driver = fieldbus_of(harness)
    for status in map(driver.status, range(driver.buses)):
        assert sum(node.axes for node in status.nodes) == status.axes
        known = status.period_s != 0.0
        assert not known or 1e-5 <= status.period_s <= 0.1, f"period of {status.period_s:g} s"
        places = [node.position for node in status.nodes]
        assert len(set(places)) in (1, len(places)), "two nodes are at one place"


@pytest.mark.clause("FaultInjector.disconnect/silent")
@pytest.mark.clause("FieldbusDriver.status/status")
def test_the_lost_node_is_the_one_that_was_lost(make_harness: MakeHarness) -> None:
    lost = []
    for axis in (0, 1):
        harness = make_harness()
        harness.start()
        if harness.count < 2:
            pytest.skip(f"the robot {harness.robot.descriptor.name} has one axis")
        driver = fieldbus_of(harness)
        harness.injector.disconnect(axis)
        harness.until(partial(is_offline, harness, axis), "the drive is offline", 3.0)
        harness.periods(5)
        found = [
            (bus, node.id)
            for bus in range(driver.buses)
            for node in driver.status(bus).nodes
            if node.offline
        ]
        assert len(found) == 1
        lost += found
    assert lost[0] != lost[1]


def is_offline(harness: Harness, axis: int) -> bool:
    return bool(harness.image.offline[axis])


def lost_frames(harness: Harness) -> int:
    """Return how many frames of bus 0 are counted as lost, also while the engine is not ready."""
    status = fieldbus_of(harness).status(0)
    return status.lost_frames + status.timeouts


def lose_frames(harness: Harness, before: int) -> int:
    """Lose frames, ``before`` are counted; return how many are then, when frames arrive again."""
    harness.injector.lose_packets(LOST)
    harness.until(lambda: lost_frames(harness) != before, "lost frames are counted", 2.0)
    harness.until(lambda: harness.robot.connection.ready, "frames arrive again")
    return lost_frames(harness)


@pytest.mark.clause("FaultInjector.lose_packets/lost")
@pytest.mark.clause("FieldbusDriver.status/status", "FieldbusDriver.reset_statistics/zero")
@pytest.mark.needs(Capability.STATISTICS)
def test_lost_frames_are_counted_until_a_reset(harness: Harness, injector: FaultInjector) -> None:
    harness.robot.fieldbus.reset_statistics(0)
    injector.lose_packets(3)
    harness.until(lambda: lost_frames(harness) >= 1, "lost frames are counted", 2.0)
    harness.until(lambda: harness.robot.connection.ready, "frames arrive again")
    assert lost_frames(harness) >= 1, "reading the counters has reset them"
    harness.robot.fieldbus.reset_statistics(0)
    assert lost_frames(harness) == 0


@pytest.mark.clause("FieldbusDriver.read_register/memory")
@pytest.mark.needs(Capability.REGISTER_READ)
def test_registers_differ_from_each_other_and_between_nodes(harness: Harness) -> None:
    nodes = [node.id for node in fieldbus_of(harness).status(0).nodes]
    blocks = [harness.robot.fieldbus.read_register(0, node, 0, 64) for node in nodes]
    assert len(set(blocks[0])) > 2, "every register has the same value"
    assert len(set(blocks)) == len(blocks), "two nodes have the same registers"


@pytest.mark.clause("FieldbusDriver.read_object/value")
@pytest.mark.needs(Capability.OBJECTS)
def test_objects_are_read_from_the_node_that_was_asked(harness: Harness) -> None:
    fieldbus = harness.robot.fieldbus
    for node in (node.id for node in fieldbus_of(harness).status(0).nodes):
        kind = fieldbus.read_object(0, node, DEVICE_TYPE)
        assert len(kind) == 4, "0x1000:00 is an UNSIGNED32 of every node"
        assert fieldbus.read_object(0, node, IDENTITY, 0)[0] in range(1, 5)
        assert fieldbus.read_object(0, node, DEVICE_TYPE) == kind


@pytest.mark.clause("FieldbusDriver.read_object/errors", "FieldbusDriver.write_object/errors")
@pytest.mark.needs(Capability.OBJECTS)
def test_an_object_that_the_node_does_not_have_is_an_error_without_effect(harness: Harness) -> None:
    fieldbus, node = harness.robot.fieldbus, fieldbus_of(harness).status(0).nodes[0].id
    kind, start = fieldbus.read_object(0, node, DEVICE_TYPE), harness.image.position.copy()
    with pytest.raises(OperationError, match=ABORT_CODE):
        fieldbus.read_object(0, node, RESERVED)
    with pytest.raises(OperationError, match=ABORT_CODE):
        fieldbus.write_object(0, node, RESERVED, 0, bytes(4))
    assert fieldbus.read_object(0, node, DEVICE_TYPE) == kind
    harness.periods(5)
    assert harness.image.servo_on.all()
    assert np.abs(harness.image.position - start).max() <= SETTLED_RAD


@pytest.mark.clause("FieldbusDriver.write_object/writes", "FieldbusDriver.read_object/value")
@pytest.mark.needs(Capability.OBJECTS)
def test_a_written_object_is_in_its_node(harness: Harness) -> None:
    """Writes each drive, back and forth; the other nodes keep theirs."""
    fieldbus, written = harness.robot.fieldbus, 0
    nodes = [node.id for node in fieldbus_of(harness).status(0).nodes if node.axes]
    for index in HARMLESS:
        try:
            before = {node: fieldbus.read_object(0, node, index) for node in nodes}
        except OperationError:
            continue
        for node in nodes:
            value = bytes(byte ^ 0x15 + place for place, byte in enumerate(before[node]))
            for data in (value, before[node], value, value, before[node]):
                fieldbus.write_object(0, node, index, 0, data)
                found = {node: fieldbus.read_object(0, node, index) for node in nodes}
                assert found == before | {node: data}, f"object 0x{index:X} of node {node}"
            written += 1
        break
    if not written:
        pytest.skip("no node has an object that may be written")
    harness.periods(5)
    assert harness.image.servo_on.all()


@pytest.mark.clause("FieldbusDriver.status/status")
@pytest.mark.clause("FieldbusDriver.read_object/value")
@pytest.mark.needs(Capability.OBJECTS)
def test_objects_are_those_of_the_status(harness: Harness) -> None:
    for node in fieldbus_of(harness).status(0).nodes:
        known = (node.vendor_id, node.product_code, node.revision, node.serial)
        for subindex, number in enumerate(known, start=1):
            if number:
                read = harness.robot.fieldbus.read_object(0, node.id, IDENTITY, subindex)
                assert int.from_bytes(read, "little") == number, f"0x1018:{subindex} of {node.id}"


@pytest.mark.clause("FieldbusDriver.reset_statistics/zero", "FieldbusDriver.status/status")
@pytest.mark.needs(Capability.STATISTICS)
def test_counters_count_again_after_a_reset(harness: Harness) -> None:
    for _ in range(2):
        harness.robot.fieldbus.reset_statistics(0)
        assert lost_frames(harness) == 0
        for _ in range(2):
            before = lost_frames(harness)
            counted = lose_frames(harness, before) - before
            most = LOST * max(1, len(fieldbus_of(harness).status(0).nodes))
            assert 0 < counted <= most, f"{counted} frames counted of {LOST}"


@pytest.mark.clause("FieldbusDriver.reset_statistics/zero", "FieldbusDriver.status/status")
@pytest.mark.needs(Capability.STATISTICS)
def test_no_counter_is_negative_after_a_restart(fresh: Harness) -> None:
    """Frames are lost, the counters are reset, and communication counts from its start."""
    bus, device = fieldbus_of(fresh), fresh.drivers.device
    lose_frames(fresh, lost_frames(fresh))
    bus.reset_statistics(0)
    device.stop_communication(10.0)
    device.start_communication(10.0)
    status = bus.status(0)
    counters = status.lost_frames, status.timeouts, status.late_cycles
    assert min(counters) >= 0, f"lost frames, timeouts, late cycles: {counters}"


@pytest.mark.clause("FieldbusDriver.status/status")
@pytest.mark.needs(Capability.STATISTICS)
def test_lost_frames_are_counted_beyond_a_byte(harness: Harness) -> None:
    if not harness.stepped:
        pytest.skip("so many frames are lost too slowly in real time")
    harness.robot.fieldbus.reset_statistics(0)
    before = 0
    while before <= BYTE:
        now = lose_frames(harness, before)
        assert now > before, f"{now} frames are lost, after {before}"
        before = now
    harness.robot.fieldbus.reset_statistics(0)


@pytest.mark.clause("DeviceDriver.scan_network/summary")
def test_a_lost_drive_is_missing_in_a_scan(fresh: Harness) -> None:
    before = fresh.drivers.device.scan_network()
    if before == DeviceDriver.scan_network(fresh.drivers.device):
        pytest.skip("the backend has no scan")
    fresh.injector.disconnect(fresh.count - 1)
    last = fresh.count - 1
    fresh.until(lambda: bool(fresh.image.offline[last]), "the lost drive is offline", 2.0)
    assert fresh.drivers.device.scan_network() != before, "a scan shows a drive that is lost"
