"""Fieldbus answers: there in every state, consistent, and without side effects."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robotd.device.capabilities import Capability
from robotd.device.drivers import FieldbusDriver, NetworkState
from robotd.testing.conformance.harness import SETTLED_RAD, Harness, MakeHarness
from robotd.testing.conformance.kit_target import FaultInjectorOrSkip

pytestmark = pytest.mark.needs(Capability.FIELDBUS)

STATES = {0, 1, 2, 4, 8, 16}
OPERATIONAL = 16


def fieldbus_of(harness: Harness) -> FieldbusDriver:
    driver = harness.parts.fieldbus_driver
    assert driver is not None, "the backend declares fieldbus and makes no driver"
    return driver


def test_it_answers_in_every_state(make_harness: MakeHarness) -> None:
    harness = make_harness()
    driver, device = fieldbus_of(harness), harness.parts.device
    assert driver.masters >= 1
    harness.begin()
    calls: list[Callable[[], object]] = [
        device.state,
        device.open,
        lambda: device.start_communication(10.0),
        lambda: device.stop_communication(10.0),
        device.close,
    ]
    for call in calls:
        call()
        for master in range(driver.masters):
            assert isinstance(driver.network_state(master), NetworkState)


def test_the_slaves_are_told_apart(harness: Harness) -> None:
    driver = fieldbus_of(harness)
    for master in range(driver.masters):
        network = driver.network_state(master)
        ids = [slave.id for slave in network.slaves]
        assert len(ids) == len(set(ids))
        assert {slave.state for slave in network.slaves} <= STATES


def test_the_drives_are_operational(harness: Harness) -> None:
    driver = fieldbus_of(harness)
    networks = [driver.network_state(master) for master in range(driver.masters)]
    assert sum(network.total_axes for network in networks) >= harness.count
    drives = [slave for network in networks for slave in network.slaves if slave.axes]
    assert all(slave.state == OPERATIONAL and not slave.offline for slave in drives)
    assert not any(slave.fault for slave in drives)


def test_what_is_told_of_it_is_text(harness: Harness) -> None:
    driver = fieldbus_of(harness)
    for network in map(driver.network_state, range(driver.masters)):
        texts = [*network.details, *network.details.values(), *(s.fault for s in network.slaves)]
        assert {type(text) for text in texts} <= {str}
        assert not any("\n" in text for text in texts)


def test_a_lost_slave_is_shown(make_harness: MakeHarness) -> None:
    harness = make_harness()
    harness.up()
    driver = fieldbus_of(harness)
    FaultInjectorOrSkip.of(harness).disconnect(0)

    def lost() -> bool:
        slaves = [s for m in range(driver.masters) for s in driver.network_state(m).slaves]
        return any(slave.offline or slave.state != OPERATIONAL for slave in slaves)

    harness.until(lost, "a slave is offline or not operational", 3.0)


@pytest.mark.needs(Capability.REGISTER_READ)
def test_registers_have_the_length_that_was_asked_for(harness: Harness) -> None:
    slave = fieldbus_of(harness).network_state(0).slaves[0].id
    for length in (1, 2, 4, 16):
        assert len(harness.robot.fieldbus.read_register(0, slave, 0x0000, length)) == length
    whole = harness.robot.fieldbus.read_register(0, slave, 0x0000, 8)
    assert harness.robot.fieldbus.read_register(0, slave, 0x0004, 4) == whole[4:]


@pytest.mark.needs(Capability.STATISTICS)
def test_counters_are_zero_after_a_reset(harness: Harness) -> None:
    harness.robot.fieldbus.reset_statistics(0)
    network = harness.robot.fieldbus.network_state(0)
    assert (network.packet_loss, network.packet_timeout, network.over_cycle) == (0, 0, 0)


@pytest.mark.needs(Capability.HOT_CONNECT)
def test_a_hot_connect_moves_and_switches_nothing(harness: Harness) -> None:
    start = harness.image.position.copy()
    harness.robot.fieldbus.start_hot_connect(0)
    harness.let(0.5)
    assert harness.image.servo_on.all()
    assert np.abs(harness.image.position - start).max() <= SETTLED_RAD
