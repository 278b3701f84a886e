from __future__ import annotations

import itertools
import struct

import pytest
from tests.plugins.sim.harness import Harness, closed_rig, harness, robot

import robotd_sim
from robotd.api import BusState, FieldbusDriver, InvalidArgument, NotReady, OperationError

GRIPPER = {"output_byte": 0, "output_bit": 0, "joints": ["finger"], "open_m": 0.0, "closed_m": 0.05}


def bus_of(made: Harness) -> FieldbusDriver:
    return robotd_sim.robotd_fieldbus(made.device)


def word(bus: FieldbusDriver, slave: int, address: int) -> int:
    return int.from_bytes(bus.read_register(0, slave, address, 2), "little")


def test_the_line_has_one_drive_per_axis_and_a_module_for_the_gripper() -> None:
    bus = bus_of(closed_rig(descriptor=robot(6, gripper=GRIPPER)))
    state = bus.status(0)
    assert bus.buses == 1
    assert [slave.axes for slave in state.nodes] == [1] * 6 + [0]
    assert state.axes == 6
    assert state.output_size == 2
    assert len({(slave.product_code, slave.serial) for slave in state.nodes}) == 7
    assert len({slave.address for slave in state.nodes}) == 7
    spans = sorted((slave.extra["input_address"], slave.input_size) for slave in state.nodes)
    assert all(a + size == b for (a, size), (b, _) in itertools.pairwise(spans))
    assert len(bus_of(harness(2)).status(0).nodes) == 2
    assert len(bus_of(harness(2, io_module=True)).status(0).nodes) == 3


def test_states_follow_the_communication() -> None:
    made = closed_rig()
    bus = bus_of(made)
    assert bus.status(0).state == BusState.CONFIGURABLE
    made.device.open()
    made.device.start_communication(1.0)
    state = bus.status(0)
    assert state.state is BusState.OPERATIONAL
    assert {slave.state for slave in state.nodes} == {BusState.OPERATIONAL}
    assert word(bus, 0, 0x0130) == 0x08
    assert word(bus, 0, 0x0440) == 1
    made.device.stop_communication(1.0)
    assert bus.status(0).nodes[0].state is BusState.CONFIGURABLE
    assert word(bus, 0, 0x0130) == 0x02


def test_registers_read_like_a_slave_controller() -> None:
    made = harness()
    bus = bus_of(made)
    image = bus.read_register(0, 1, 0, 0x1000)
    assert len(image) == 4096
    kind, revision = image[0], image[1]
    assert kind == 0x11
    assert revision > 0
    assert word(bus, 1, 0x0010) == bus.status(0).nodes[1].address
    assert word(bus, 0, 0x0110) & 0x30 == 0x30  # links on both ports
    assert word(bus, 1, 0x0110) & 0x30 == 0x10  # the line ends here
    assert image[0x300:0x314] == bytes(20)
    (before,) = struct.unpack("<Q", bus.read_register(0, 0, 0x0910, 8))
    made.clock.advance(0.5)
    (after,) = struct.unpack("<Q", bus.read_register(0, 0, 0x0910, 8))
    assert after - before == 500_000_000


def test_statistics_count_and_can_be_reset() -> None:
    made = harness()
    bus = bus_of(made)
    made.clock.advance(0.1)
    state = bus.status(0)
    assert state.period_s == 0.001
    assert 0 < state.extra["min_tx_delay"] <= state.extra["tx_delay"] <= state.extra["max_tx_delay"]
    made.faults.drop_communication()
    assert bus.status(0).lost_frames == 1
    bus.reset_statistics(0)
    state = bus.status(0)
    assert (state.lost_frames, state.extra["tx_delay"], state.extra["max_tx_delay"]) == (0, 0, 0)


def test_losses_that_overlap_follow_each_other() -> None:
    made = harness()
    made.look(0.1)
    made.faults.lose_packets(100)
    made.clock.advance(0.01)
    made.faults.lose_packets(10)
    fresh_ns = made.image.fresh_ns
    assert made.look(0.08).fresh_ns == fresh_ns
    assert made.device.fault() == "no frame comes back from the fieldbus"
    assert bus_of(made).status(0).lost_frames == 110
    assert made.look(0.02).fresh_ns == made.clock.now_ns()
    assert made.device.fault() == ""
    made.faults.freeze(True)
    made.faults.lose_packets(3)
    fresh_ns = made.image.fresh_ns
    assert made.look(0.1).fresh_ns == fresh_ns
    made.faults.freeze(False)
    assert made.look(0.1).fresh_ns > fresh_ns


def test_hot_connect_brings_a_lost_slave_back_with_its_servo_off() -> None:
    made = harness(hot_connect_delay_s=0.2)
    bus = bus_of(made)
    before = made.look(0.1).position[0]
    made.faults.disconnect(0)
    image = made.look()
    assert image.offline[0]
    assert not image.servo_on[0]
    assert image.position[0] == before
    assert not image.offline[1]
    state = bus.status(0)
    assert state.nodes[0].offline
    assert state.nodes[0].state is BusState.UNKNOWN
    assert "no answer from 0" in made.device.scan_network()
    with pytest.raises(OperationError, match="slave 0 on master 0 does not answer"):
        bus.read_register(0, 0, 0, 1)
    with pytest.raises(NotReady, match="axis 0: the drive is offline"):
        made.axes.servo(0, True, 1.0)
    bus.start_hot_connect(0)
    assert made.look(0.3).offline[0], "its plug is still out"
    made.faults.disconnect(1)
    made.faults.reconnect(0)
    bus.start_hot_connect(0)
    assert made.look(0.19).offline[0]
    image = made.look(0.02)
    assert image.offline.tolist() == [False, True]
    assert not image.servo_on[0]
    made.axes.servo(0, True, 1.0)


def test_what_does_not_exist_is_rejected_with_the_limits() -> None:
    bus = bus_of(harness())
    with pytest.raises(InvalidArgument, match=r"master 1 .* only master 0"):
        bus.status(1)
    with pytest.raises(InvalidArgument, match=r"slave 2 .* 0 to 1"):
        bus.read_register(0, 2, 0, 1)
    with pytest.raises(InvalidArgument, match=r"0xFFF to 0x1000 .* 0xFFF"):
        bus.read_register(0, 0, 0xFFF, 2)
    with pytest.raises(NotReady, match="no device is open"):
        bus_of(closed_rig()).read_register(0, 0, 0, 1)
