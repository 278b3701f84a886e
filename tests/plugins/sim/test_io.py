from __future__ import annotations

import pytest
from tests.plugins.sim.harness import TICK_S, Harness, closed_rig, harness

import robotd_sim
from robotd.api import InvalidArgument, IoDriver, NotReady


def io_of(made: Harness) -> IoDriver:
    return robotd_sim.robotd_io(made.device)


def test_outputs_keep_what_was_written_until_the_engine_ends() -> None:
    made = harness()
    io = io_of(made)
    io.write_outputs(7990, bytes(range(10)))
    io.write_output_bit(7990, 7, True)
    io.write_output_bit(7991, 0, False)
    assert io.read_outputs(7989, 4) == bytes([0, 0x80, 0, 2])
    made.device.stop_communication(1.0)
    assert io.read_outputs(7990, 1) == b"\x80"
    made.device.close()
    assert io.read_outputs(0, 8000) == bytes(8000)


def test_inputs_are_set_by_sensors_and_by_a_wire_from_the_outputs() -> None:
    made = harness(io_loopback=True)
    io = io_of(made)
    made.faults.set_input_bit(3, 2, True)
    assert io.read_inputs(3, 1) == b"\x04"
    io.write_outputs(0, b"\xa5")
    assert io.read_inputs(0, 1) == b"\x00"
    made.clock.advance(TICK_S)
    assert io.read_inputs(0, 1) == b"\xa5"
    made.faults.set_input_bit(3, 2, False)
    assert io.read_inputs(3, 1) == b"\x00"


def test_inputs_may_be_on_at_power_on() -> None:
    made = harness(initial_inputs=[0, 0x21])
    io = io_of(made)
    assert io.read_inputs(0, 3) == b"\x00\x21\x00"
    made.faults.set_input_bit(1, 0, False)
    assert io.read_inputs(1, 1) == b"\x20"
    made.device.close()
    assert io.read_inputs(0, 3) == b"\x00\x21\x00"


def test_addresses_outside_of_the_image_are_rejected_with_its_limits() -> None:
    io = io_of(harness())
    assert (io.input_bytes, io.output_bytes) == (8000, 8000)
    with pytest.raises(InvalidArgument, match=r"bytes 7999 to 8000 .* 0 to 7999"):
        io.read_inputs(7999, 2)
    with pytest.raises(InvalidArgument, match="bit 8"):
        io.write_output_bit(0, 8, True)


def test_writing_needs_an_open_device() -> None:
    io = io_of(closed_rig())
    assert io.read_inputs(0, 2) == b"\x00\x00"
    with pytest.raises(NotReady, match="no device is open"):
        io.write_outputs(0, b"\x01")
