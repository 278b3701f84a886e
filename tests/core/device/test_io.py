"""Digital I/O: every address is checked, and neighbours are left alone."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.core.device.harness import Harness

from robotd.clock import NANOSECONDS
from robotd.descriptor import GripperSettings, IoAddress
from robotd.device.gripper import Gripper
from robotd.device.io import Io
from robotd.device.process_image import ProcessImage
from robotd.device.stop_latch import StopLatch
from robotd.errors import InvalidArgument, NotReady, Unsupported


def test_bits_and_bytes_are_read_from_both_images(harness: Harness) -> None:
    harness.io_driver.inputs[2:4] = b"\x01\x80"
    harness.io_driver.outputs[0] = 0b100
    assert harness.io.input_bit(3, 7)
    assert not harness.io.input_bit(3, 0)
    assert harness.io.input_bytes(2, 2) == b"\x01\x80"
    assert harness.io.output_bit(0, 2)
    assert harness.io.output_bytes(0, 1) == b"\x04"


@given(before=st.integers(0, 255), bit=st.integers(0, 7), value=st.booleans())
def test_a_bit_is_written_without_its_neighbours(before: int, bit: int, value: bool) -> None:
    harness = Harness().make_ready()
    harness.io_driver.outputs[5] = before
    harness.io.set_output_bit(5, bit, value)
    after = harness.io_driver.outputs[5]
    assert bool(after >> bit & 1) is value
    assert (after ^ before) & ~(1 << bit) == 0


def test_bytes_are_written(harness: Harness) -> None:
    harness.io.set_output_bytes(6, b"\xaa\xbb")
    assert harness.io_driver.outputs[6:8] == b"\xaa\xbb"


@pytest.mark.parametrize("bit", [-1, 8])
def test_a_bit_outside_a_byte_is_rejected(harness: Harness, bit: int) -> None:
    for call in (harness.io.input_bit, harness.io.output_bit):
        with pytest.raises(InvalidArgument, match=rf"^bit {bit} is outside 0\.\.7$"):
            call(0, bit)
    with pytest.raises(InvalidArgument, match=rf"^bit {bit} is outside 0\.\.7$"):
        harness.io.set_output_bit(0, bit, True)
    assert harness.io_driver.calls == []


@pytest.mark.parametrize(("byte", "length"), [(-1, 1), (8, 1), (7, 2), (0, 9)])
def test_bytes_outside_the_image_are_rejected(harness: Harness, byte: int, length: int) -> None:
    place = rf"bytes {byte}\.\.{byte + length - 1} are outside 0\.\.7$"
    with pytest.raises(InvalidArgument, match=f"^input {place}"):
        harness.io.input_bytes(byte, length)
    with pytest.raises(InvalidArgument, match=f"^output {place}"):
        harness.io.output_bytes(byte, length)
    with pytest.raises(InvalidArgument, match=f"^output {place}"):
        harness.io.set_output_bytes(byte, bytes(length))
    assert harness.io_driver.calls == []


def test_no_bytes_at_all_are_rejected(harness: Harness) -> None:
    for call in (lambda: harness.io.input_bytes(0, 0), lambda: harness.io.set_output_bytes(0, b"")):
        with pytest.raises(InvalidArgument, match="length 0 is less than 1"):
            call()


def test_nothing_is_read_or_written_before_the_engine_is_ready() -> None:
    harness = Harness()
    for call in (
        lambda: harness.io.input_bit(0, 0),
        lambda: harness.io.output_bytes(0, 1),
        lambda: harness.io.set_output_bit(0, 0, True),
        lambda: harness.io.set_output_bytes(0, b"\x01"),
    ):
        with pytest.raises(NotReady, match="state Idle"):
            call()
    assert harness.io_driver.calls == []


def test_a_backend_without_io_says_so(harness: Harness) -> None:
    io = Io(None, harness.connection, "fake")
    with pytest.raises(Unsupported, match="digital I/O: not supported by the fake backend"):
        io.input_bit(0, 0)
    with pytest.raises(Unsupported, match="not supported by the fake backend"):
        io.output_watcher(0, 0)


def test_bits_are_read_and_written_by_name(harness: Harness) -> None:
    inputs, outputs = {"part_present": IoAddress(3, 7)}, {"lamp": IoAddress(1, 2)}
    io = Io(harness.io_driver, harness.connection, "fake", None, inputs, outputs)
    assert not io.input("part_present")
    harness.io_driver.inputs[3] = 0x80
    assert io.input("part_present")
    io.set_output("lamp", True)
    assert harness.io_driver.outputs[1] == 0b100
    assert io.output("lamp")
    unknown = (
        r"unknown input 'part_presnt'; did you mean 'part_present'\? \(available: part_present\)"
    )
    with pytest.raises(InvalidArgument, match=unknown):
        io.input("part_presnt")
    for call in (io.output, lambda name: io.set_output(name, True)):
        with pytest.raises(InvalidArgument, match="unknown output 'part_present'"):
            call("part_present")


GRIPPER = GripperSettings(
    output_byte=1, output_bit=3, joints=("left", "right"), open_m=0.0, closed_m=0.04
)


def closed_at(gripper: Gripper, time_ns: int) -> float:
    """Advance the fingers to ``time_ns``; return how far they are closed."""
    image = ProcessImage(1)
    image.stamp_ns = time_ns
    gripper.advance(image)
    return gripper.closed


def test_a_gripper_closes_and_opens_by_its_bit(harness: Harness) -> None:
    gripper = Gripper(harness.io, GRIPPER, harness.clock, StopLatch())
    assert closed_at(gripper, 0) == 0.0
    gripper.command(True)
    assert harness.io_driver.outputs[1] == 0b1000
    assert closed_at(gripper, 1) == 1.0
    gripper.command(False)
    assert closed_at(gripper, 2) == 0.0


def test_fingers_travel_at_constant_speed_from_wherever_they_are(harness: Harness) -> None:
    slow = GRIPPER.model_copy(update={"travel_time_s": 0.5})
    gripper = Gripper(harness.io, slow, harness.clock, StopLatch())
    start_ns = 10 * NANOSECONDS
    closed_at(gripper, start_ns)
    gripper.command(True)
    assert closed_at(gripper, start_ns + NANOSECONDS // 10) == pytest.approx(0.2)
    gripper.command(False)
    assert closed_at(gripper, start_ns + 3 * NANOSECONDS // 20) == pytest.approx(0.1)
    assert closed_at(gripper, start_ns + NANOSECONDS) == 0.0
    gripper.command(True)
    assert closed_at(gripper, start_ns + 2 * NANOSECONDS) == 1.0


def test_a_gripper_outside_the_output_image_is_rejected_when_it_is_made(harness: Harness) -> None:
    beyond = GRIPPER.model_copy(update={"output_byte": 8})
    with pytest.raises(InvalidArgument, match=r"output bytes 8\.\.8 are outside 0\.\.7"):
        Gripper(harness.io, beyond, harness.clock, StopLatch())


def test_a_gripper_does_not_move_before_the_engine_is_ready() -> None:
    harness = Harness()
    gripper = Gripper(harness.io, GRIPPER, harness.clock, StopLatch())
    with pytest.raises(NotReady):
        gripper.command(True)
    assert closed_at(gripper, 0) == 0.0
