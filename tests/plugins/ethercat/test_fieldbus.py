"""Diagnostics: states, counters, registers, objects, I/O."""

from __future__ import annotations

import pytest
from tests.plugins.ethercat.harness import Harness

from robotd.device.bus_status import BusState
from robotd.errors import DeviceTimeout, InvalidArgument, NotReady
from robotd_ethercat.al_status import AlState
from robotd_ethercat.fieldbus import EthercatFieldbus


def test_the_status_has_state_identity_and_sizes_of_every_slave(harness: Harness) -> None:
    harness.robot.step(5)
    status = harness.robot.fieldbus.status(0)
    assert status.state is BusState.OPERATIONAL
    assert [node.state for node in status.nodes] == [BusState.OPERATIONAL] * 3
    drive, module = status.nodes[0], status.nodes[2]
    assert (drive.vendor_id, drive.product_code, drive.serial) == (0x1234, 0x5678, 77)
    assert (drive.axes, module.axes, module.input_size) == (1, 0, 2)
    assert status.extra["rx_pdo_size"] == 13 + 13 + 2
    assert status.details["working counter"] == "9 of 9"


def test_port_counters_are_shown_and_cleared(harness: Harness) -> None:
    registers = harness.slave(1).registers
    registers[0x0302], registers[0x0309], registers[0x0311] = 3, 5, 2
    status = harness.robot.fieldbus.status(0)
    extra = status.nodes[1].extra
    assert extra["invalid_frames"] == 3
    assert extra["forwarded_errors"] == 5
    assert extra["lost_links"] == 2
    expected = "port 1: lost links 2, invalid frames 3, forwarded errors 5"
    assert status.details["ports of joint2 (slave 1)"] == expected
    harness.robot.fieldbus.reset_statistics(0)
    assert "ports of joint2 (slave 1)" not in harness.robot.fieldbus.status(0).details


def test_registers_and_objects_are_read_beside_the_cycle(harness: Harness) -> None:
    harness.slave(0).registers[0x0130:0x0132] = b"\x08\x00"
    fieldbus = harness.robot.fieldbus
    assert fieldbus.read_register(0, 0, 0x0130, 2) == b"\x08\x00"
    assert fieldbus.read_object(0, 1, 0x6065) == b"\xff" * 4
    fieldbus.write_object(0, 1, 0x6065, 0, (900).to_bytes(4, "little"))
    assert harness.slave(1).values[0x6065, 0] == 900
    with pytest.raises(InvalidArgument, match="outside"):
        fieldbus.read_register(0, 0, 0x0FFF, 2)


def test_an_object_costs_no_register_and_a_status_each_once(
    harness: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The counters of all ports were read twice before each SDO."""
    read, asked = harness.bus.read_register, list[int]()

    def counted(slave: int, address: int, size: int) -> bytes:
        asked.append(slave)
        return read(slave, address, size)

    monkeypatch.setattr(harness.bus, "read_register", counted)
    harness.robot.fieldbus.read_object(0, 1, 0x6065)
    with pytest.raises(InvalidArgument, match=r"node 7 is not on bus 0 \(nodes: \[0, 1, 2\]\)"):
        harness.robot.fieldbus.read_object(0, 7, 0x6065)
    assert asked == []
    harness.robot.fieldbus.status(0)
    assert asked == [0, 1, 2]


def test_a_lost_slave_is_shown_with_its_al_code(harness: Harness) -> None:
    harness.slave(1).state, harness.slave(1).code = AlState.SAFE_OP, 0x001B
    harness.master.supervision.check()
    status = EthercatFieldbus(harness.master).status(0)
    node = status.nodes[1]
    assert (node.state, node.error_code, node.offline) == (BusState.INPUTS_ONLY, 0x001B, True)
    assert "sync manager watchdog" in node.fault
    assert "joint2 (slave 1)" in status.note


def test_a_slave_that_was_never_found_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    fieldbus = EthercatFieldbus(Harness(monkeypatch).master)
    with pytest.raises(NotReady, match=r"joint1 \(slave 0\): it has not been found"):
        fieldbus.read_object(0, 0, 0x6041, 0)
    assert fieldbus.status(0).state is BusState.INITIALISING


def test_counters_of_a_slave_without_answer_are_left_out(harness: Harness) -> None:
    harness.slave(2).present = False
    assert "invalid_frames" not in harness.robot.fieldbus.status(0).nodes[2].extra
    harness.robot.fieldbus.reset_statistics(0)
    with pytest.raises(DeviceTimeout):
        harness.master.slaves[2].read_register(0x0130, 2)


def test_inputs_and_outputs_of_a_module(harness: Harness) -> None:
    io = harness.master.io
    harness.slave(2).input = b"\x81\x02"
    io.write_output_bit(1, 3, True)
    harness.robot.step(3)
    assert io.read_inputs(0, 2) == b"\x81\x02"
    assert harness.slave(2).output == io.read_outputs(0, 2) == b"\x00\x08"
    assert bytes(io.live[0]) == b"\x81\x02"
    assert (io.input_bytes, io.output_bytes) == (2, 2)
    with pytest.raises(InvalidArgument, match=r"no module serves output bytes 2\.\.2"):
        io.write_outputs(2, b"\x00")
    harness.slave(2).present = False
    harness.robot.step(6)
    harness.master.supervision.check()
    with pytest.raises(NotReady, match=r"I/O module \(slave 2\): no answer"):
        io.write_outputs(0, b"\x00")
