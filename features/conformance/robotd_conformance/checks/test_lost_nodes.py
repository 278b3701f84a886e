"""Nodes that are lost and taken in again: they say so, and no old value counts for them."""

from __future__ import annotations

import pytest

from robotd.api import (
    BusNode,
    BusState,
    Capability,
    DeviceDriver,
    DeviceTimeout,
    FieldbusDriver,
    OperationError,
)
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.test_bus_objects import STATUSWORD
from robotd_conformance.checks.test_fieldbus import DEVICE_TYPE, fieldbus_of

pytestmark = pytest.mark.needs(Capability.FIELDBUS)

LOST_S = 3.0
ENDS_S = 1.0  # a hot connect does not say when it has ended; it may take in what is lost meanwhile


def nodes_of(bus: FieldbusDriver) -> list[tuple[int, BusNode]]:
    """Return the nodes of all buses, with the number of their bus."""
    return [(number, node) for number in range(bus.buses) for node in bus.status(number).nodes]


@pytest.mark.clause("FieldbusDriver.status/status", "FieldbusDriver.status/offline")
@pytest.mark.clause("FieldbusDriver.read_object/errors")
@pytest.mark.parametrize("place", [0, -1], ids=["first", "last"])
def test_a_lost_node_is_not_operational_and_says_why(fresh: Harness, place: int) -> None:
    bus, axis = fieldbus_of(fresh), place % fresh.count
    before = {(number, node.id): node for number, node in nodes_of(bus)}
    fresh.injector.disconnect(axis)
    fresh.until(lambda: bool(fresh.image.offline[axis]), "the drive is offline", LOST_S)
    fresh.wait_until(lambda: not problems(bus), LOST_S)
    assert not problems(bus), "; ".join(problems(bus))
    for number, node in nodes_of(bus):
        if node.offline:
            check_silence(fresh, bus, number, node.id)
        else:
            was = before[number, node.id]
            assert (node.state, node.fault, node.error_code) == (
                was.state,
                was.fault,
                was.error_code,
            ), f"node {node.id} is shown as faulty, too"


@pytest.mark.clause("FieldbusDriver.status/offline", "AxisDriver.read/states")
def test_a_drive_whose_servo_is_off_is_lost_as_well(fresh: Harness) -> None:
    fresh.disable()
    last = fresh.count - 1
    fresh.injector.disconnect(last)
    fresh.until(lambda: bool(fresh.image.offline[last]), "the drive is offline", LOST_S)


@pytest.mark.clause("AxisDriver.confirmed_off/confirmed", "AxisDriver.confirmed_off/after")
@pytest.mark.parametrize("lost", [False, True], ids=["all there", "last lost"])
def test_a_drive_is_confirmed_to_be_off_where_it_answers(fresh: Harness, lost: bool) -> None:
    driver, last = fresh.drivers.axes, fresh.count - 1
    if lost:
        fresh.injector.disconnect(last)
        fresh.until(lambda: bool(fresh.image.offline[last]), "the drive is offline", LOST_S)
    fresh.robot.connection.stop_communication()
    confirmed = driver.confirmed_off()
    if confirmed is None:
        pytest.skip("no confirmations are kept")
    expected = [not (lost and axis == last) for axis in fresh.all]
    assert list(confirmed) == expected, (
        f"confirmed to be off: {list(confirmed)}, drives that answer: {expected}"
    )


def problems(bus: FieldbusDriver) -> list[str]:
    """Name what is wrong with the nodes while one of them is lost."""
    nodes = [node for _, node in nodes_of(bus)]
    lost = [node for node in nodes if node.offline]
    found = [] if lost else ["no node is offline"]
    for node in lost:
        if node.state is BusState.OPERATIONAL:
            found.append(f"node {node.id} is offline and operational")
        if not node.fault and not node.error_code:
            found.append(f"node {node.id} is offline without a fault")
    return found


def check_silence(harness: Harness, bus: FieldbusDriver, number: int, node: int) -> None:
    """A node that does not answer gives no object, remembered ones included."""
    if harness.can(Capability.OBJECTS):
        for index in (DEVICE_TYPE, STATUSWORD):
            with pytest.raises((OperationError, DeviceTimeout)):
                bus.read_object(number, node, index, 0)


@pytest.mark.needs(Capability.HOT_CONNECT)
@pytest.mark.clause("FieldbusDriver.start_hot_connect/joins", "FieldbusDriver.status/status")
@pytest.mark.clause("DeviceDriver.scan_network/summary")
@pytest.mark.clause("AxisDriver/servos")
def test_a_hot_connect_takes_in_all_nodes_each_time(fresh: Harness) -> None:
    """The first and the last drive at once, twice; then they are operational without a fault."""
    bus, injector = fieldbus_of(fresh), fresh.injector
    cut = list(dict.fromkeys((0, fresh.count - 1)))
    for _ in range(2):
        for axis in cut:
            injector.disconnect(axis)
        fresh.until(lambda: bool(fresh.image.offline[cut].all()), "the drives are offline", LOST_S)
        lost = scan(fresh)
        for axis in cut:
            injector.reconnect(axis)
        bus.start_hot_connect(0)
        fresh.until(lambda: not fresh.image.offline.any(), "all drives are back")
        fresh.until(
            lambda: not any(map(is_faulty, nodes_of(bus))), "all nodes are operational", 2.0
        )
        assert scan(fresh) != lost or not lost, "a scan shows drives as lost that are back"
        assert not fresh.image.servo_on[cut].any(), "a servo was enabled by itself"
        fresh.enable()
        fresh.pass_time(ENDS_S)


def is_faulty(place: tuple[int, BusNode]) -> bool:
    node = place[1]
    return node.offline or (node.axes > 0 and node.state is not BusState.OPERATIONAL)


def scan(harness: Harness) -> str:
    """Return what a scan says; "" where there is none."""
    said = harness.drivers.device.scan_network()
    return "" if said == DeviceDriver.scan_network(harness.drivers.device) else said
