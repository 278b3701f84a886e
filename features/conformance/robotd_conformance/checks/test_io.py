"""Digital I/O: what is written is there, and nothing else has changed.

The checks write the last three bytes of the output image and put back what was there.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from statistics import median

import pytest

from robotd.api import (
    Capability,
    FaultInjector,
    InvalidArgument,
    IoDriver,
    OperationError,
    Unsupported,
)
from robotd.api.features import MAX_IO_BYTES
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.stopwatch import timed

pytestmark = pytest.mark.needs(Capability.IO)


def io_of(harness: Harness) -> IoDriver:
    """Return the I/O of a device; without outputs, skip the check."""
    driver = harness.drivers.io
    if driver is None or driver.output_bytes == 0:
        pytest.skip("the device has no outputs")
    return driver


@pytest.fixture
def io(harness: Harness) -> Iterator[IoDriver]:
    driver = io_of(harness)
    before = driver.read_outputs(0, driver.output_bytes)
    yield driver
    driver.write_outputs(0, before)


def outputs(harness: Harness, io: IoDriver, expected: bytes, byte: int) -> None:
    """Wait for the outputs. Raises AssertionError with what they are instead."""
    harness.wait_until(lambda: io.read_outputs(byte, len(expected)) == expected, 2.0)
    seen = io.read_outputs(byte, len(expected))
    assert seen == expected, (
        f"outputs from byte {byte} on are {seen.hex()} after 2 s, not {expected.hex()}"
    )


def window(io: IoDriver) -> tuple[int, int]:
    """First byte and size of what the checks may write."""
    size = min(3, io.output_bytes)
    return io.output_bytes - size, size


@pytest.mark.clause("IoDriver.input_bytes/size", "IoDriver.output_bytes/size")
def test_the_images_have_a_size(harness: Harness, io: IoDriver) -> None:
    assert io.input_bytes >= 0
    assert len(io.read_outputs(0, io.output_bytes)) == io.output_bytes
    if io.input_bytes:
        assert len(io.read_inputs(0, io.input_bytes)) == io.input_bytes


@pytest.mark.clause("IoDriver.read_outputs/bytes")
@pytest.mark.clause("IoDriver.write_output_bit/bit")
def test_a_bit_leaves_its_neighbours_alone(harness: Harness, io: IoDriver) -> None:
    first, size = window(io)
    middle = size // 2
    for pattern in (0x00, 0xFF, 0x5A):
        for bit in range(8):
            value = not pattern >> bit & 1
            io.write_outputs(first, bytes([pattern] * size))
            outputs(harness, io, bytes([pattern] * size), first)
            io.write_output_bit(first + middle, bit, value)
            expected = bytearray([pattern] * size)
            expected[middle] ^= 1 << bit
            outputs(harness, io, bytes(expected), first)


@pytest.mark.clause("IoDriver.read_outputs/bytes", "IoDriver.read_inputs/bytes")
def test_what_was_read_stays_as_it_was(harness: Harness, io: IoDriver) -> None:
    first, size = window(io)
    io.write_outputs(first, bytes([0x5A] * size))
    outputs(harness, io, bytes([0x5A] * size), first)
    read = io.read_outputs(first, size)
    assert type(read) is bytes
    assert io.input_bytes == 0 or type(io.read_inputs(0, 1)) is bytes
    io.write_outputs(first, bytes([0xA5] * size))
    outputs(harness, io, bytes([0xA5] * size), first)
    assert read == bytes([0x5A] * size), "bytes that were read before have changed"


@pytest.mark.clause("IoDriver.write_outputs/bytes")
def test_bytes_leave_their_neighbours_alone(harness: Harness, io: IoDriver) -> None:
    first, size = window(io)
    for index in range(size):
        io.write_outputs(first, bytes([0xA5] * size))
        io.write_outputs(first + index, bytes([0x3C]))
        expected = bytearray([0xA5] * size)
        expected[index] = 0x3C
        outputs(harness, io, bytes(expected), first)


@pytest.mark.clause("IoDriver.write_outputs/bytes")
def test_the_other_outputs_stay_as_they_are(harness: Harness, io: IoDriver) -> None:
    first, size = window(io)
    if harness.can(Capability.SIMULATED):
        io.write_outputs(0, bytes([0x5A] * io.output_bytes))
    before = io.read_outputs(0, io.output_bytes)
    io.write_outputs(first, bytes([0xFF] * size))
    outputs(harness, io, bytes([0xFF] * size), first)
    assert io.read_outputs(0, io.output_bytes)[:first] == before[:first]


@pytest.mark.clause("IoDriver.read_outputs/blocks", "IoDriver.read_inputs/blocks")
def test_reading_does_not_block(harness: Harness, io: IoDriver) -> None:
    for read, size in ((io.read_outputs, io.output_bytes), (io.read_inputs, io.input_bytes)):
        durations = list[float]()
        for _ in range(200 if size else 0):
            with timed(durations):
                read(0, 1)
        assert median(durations or [0.0]) < 0.25 * harness.period_s, f"{read.__name__} blocks"


@pytest.mark.clause("IoDriver.read_inputs/bytes")
def test_an_input_shows_its_sensor(harness: Harness, io: IoDriver, injector: FaultInjector) -> None:
    if io.input_bytes == 0:
        pytest.skip("the device has no inputs")
    for value in (True, False):
        injector.set_input_bit(0, 3, value)
        harness.until(partial(follows, harness, value), "the input follows its sensor")


def follows(harness: Harness, value: bool) -> bool:
    return harness.robot.io.input_bit(0, 3) is value


@pytest.mark.clause("IoDriver.output_bytes/size")
def test_addresses_outside_are_rejected(harness: Harness, io: IoDriver) -> None:
    for call in (
        lambda: harness.robot.io.set_output_bit(io.output_bytes, 0, True),
        lambda: harness.robot.io.set_output_bit(0, 8, True),
        lambda: harness.robot.io.output_bytes(io.output_bytes - 1, 2),
        lambda: harness.robot.io.input_bytes(-1, 1),
    ):
        with pytest.raises(InvalidArgument):
            call()


@pytest.mark.clause("FaultInjector.output_bit/lamp")
@pytest.mark.clause("IoDriver.write_outputs/bytes")
def test_outputs_are_at_the_terminals(
    harness: Harness, io: IoDriver, injector: FaultInjector
) -> None:
    first, size = window(io)
    for pattern in (0x00, 0xB1, 0x4E):  # other patterns when the bits are reversed
        io.write_outputs(first, bytes([pattern] * size))
        for bit in range(8):
            level = bool(pattern >> bit & 1)
            harness.until(partial(shows, injector, first, bit, level), "the terminal shows it")


def places(io: IoDriver) -> list[int]:
    """Bytes of the input image that belong to different modules, where there are several."""
    last = io.input_bytes - 1
    return sorted({0, 1, 2, 3, 4, 7, 8, 16, last // 2, last} & set(range(last + 1)))


@pytest.mark.clause("FaultInjector.set_input_bit/sensor")
@pytest.mark.clause("IoDriver.read_inputs/bytes", "IoDriver.live/images")
def test_each_input_is_at_its_address(
    harness: Harness, io: IoDriver, injector: FaultInjector
) -> None:
    """One sensor after the other, of every module: its bit changes and no other."""
    if io.input_bytes == 0:
        pytest.skip("the device has no inputs")
    before = io.read_inputs(0, io.input_bytes)
    for byte in places(io):
        for bit in {byte % 8, 7 - byte % 8}:
            value = not before[byte] >> bit & 1
            try:
                harness.set_input_bit(byte, bit, value)
            except Unsupported:  # a gap between two modules
                continue
            expected = bytearray(before)
            expected[byte] ^= 1 << bit
            shown = partial(inputs_are, io, bytes(expected))
            harness.until(shown, f"input {byte}.{bit} alone has changed", 2.0)
            injector.set_input_bit(byte, bit, not value)
            harness.until(partial(inputs_are, io, before), "the input is as before", 2.0)


def inputs_are(io: IoDriver, expected: bytes) -> bool:
    """The image is ``expected``, read at once and in parts, by both ways."""
    size = len(expected)
    parts = [(0, size), (size // 2, size - size // 2), (size - 1, 1), (0, 1)]
    right = all(io.read_inputs(at, count) == expected[at : at + count] for at, count in parts)
    return right and (io.live is None or is_live(io.live[0], expected))


def is_live(image: memoryview, expected: bytes) -> bool:
    """``image`` is ``expected``, or the part of a large one that is recorded."""
    return len(image) >= min(MAX_IO_BYTES, len(expected)) and expected.startswith(image)


@pytest.mark.clause(
    "IoDriver.write_outputs/bytes", "IoDriver.read_outputs/bytes", "IoDriver.live/images"
)
@pytest.mark.needs(Capability.SIMULATED)
def test_each_output_byte_is_at_its_address(
    harness: Harness, io: IoDriver, injector: FaultInjector
) -> None:
    size = io.output_bytes
    pattern = bytes((37 * index + 11) % 251 for index in range(size))
    for written in (pattern, bytes(255 - byte for byte in pattern)):
        io.write_outputs(0, written)
        outputs(harness, io, written, 0)
        assert io.read_outputs(size // 2, size - size // 2) == written[size // 2 :]
        if io.live is not None:
            shown = partial(is_live, io.live[1], written)
            harness.until(shown, "the live image shows what was written", 2.0)
        for byte in {0, 1, 2, size // 2, size - 1} & set(range(size)):
            for bit in range(8):
                level = bool(written[byte] >> bit & 1)
                harness.until(partial(shows, injector, byte, bit, level), "the terminal shows it")


@pytest.mark.clause("IoDriver.write_output_bit/bit", "IoDriver.write_outputs/bytes")
def test_an_output_that_is_written_again_stays(harness: Harness, io: IoDriver) -> None:
    byte = io.output_bytes - 1
    for value in (True, True, False, False, True, True, True):
        for bit in (0, 7):
            io.write_output_bit(byte, bit, value)
            harness.until(partial(output_is, io, byte, bit, value), "the output keeps its value")
        harness.periods(3)
        assert output_is(io, byte, 0, value)
    for data in (b"\x3c", b"\x3c", b"\xc3", b"\xc3"):
        io.write_outputs(byte, data)
        outputs(harness, io, data, byte)
        harness.pass_time(0.1)
        assert io.read_outputs(byte, 1) == data, "an output goes back by itself"


def output_is(io: IoDriver, byte: int, bit: int, value: bool) -> bool:
    return bool(io.read_outputs(byte, 1)[0] >> bit & 1) is value


@pytest.mark.clause("IoDriver.read_inputs/bytes")
@pytest.mark.needs(Capability.SIMULATED)
def test_outputs_are_no_inputs(harness: Harness, io: IoDriver) -> None:
    if io.input_bytes == 0:
        pytest.skip("the device has no inputs")
    first, size = window(io)
    before = io.read_inputs(0, io.input_bytes)
    for pattern in (0x00, 0xFF):
        io.write_outputs(first, bytes([pattern] * size))
        harness.periods(5)
        assert io.read_inputs(0, io.input_bytes) == before


@pytest.mark.clause("drivers/rejects")
def test_nothing_is_written_while_no_device_is_open(unopened: Harness) -> None:
    driver = io_of(unopened)
    with pytest.raises(OperationError):
        driver.write_outputs(0, bytes(1))
    with pytest.raises(OperationError):
        driver.write_output_bit(0, 0, False)


def shows(injector: FaultInjector, byte: int, bit: int, level: bool) -> bool:
    return injector.output_bit(byte, bit) is level


@pytest.mark.clause("FaultInjector.stick_output_bit/sticks", "FaultInjector.output_bit/lamp")
def test_a_stuck_output_obeys_again_when_it_is_released(
    harness: Harness, io: IoDriver, injector: FaultInjector
) -> None:
    """Sticks on and off, twice; another output beside it obeys meanwhile."""
    byte = io.output_bytes - 1
    for stuck in (True, False) * 2:
        io.write_outputs(byte, bytes([0x00 if stuck else 0xFF]))
        injector.stick_output_bit(byte, 5, stuck)
        for level in (not stuck, stuck, not stuck):
            for bit in (5, 2):
                io.write_output_bit(byte, bit, level)
            harness.until(partial(shows, injector, byte, 2, level), "the output beside it obeys")
            harness.until(partial(shows, injector, byte, 5, stuck), "an output sticks")
        injector.stick_output_bit(byte, 5, None)
        for level in (stuck, not stuck):
            io.write_output_bit(byte, 5, level)
            harness.until(partial(shows, injector, byte, 5, level), "it obeys again")
