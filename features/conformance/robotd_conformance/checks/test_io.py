"""Digital I/O: what is written is there, and nothing beside it has changed.

The checks write the last three bytes of the output image and put back what was there.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import partial
from statistics import median

import pytest

from robotd.device.capabilities import Capability
from robotd.device.drivers import IoDriver
from robotd.device.fault_injector import FaultInjector
from robotd.errors import InvalidArgument, OperationError
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.stopwatch import timed

pytestmark = pytest.mark.needs(Capability.IO)


@pytest.fixture
def io(harness: Harness) -> Iterator[IoDriver]:
    driver = harness.drivers.io
    if driver is None or driver.output_bytes == 0:
        pytest.skip("the device has no outputs")
    before = driver.read_outputs(0, driver.output_bytes)
    yield driver
    driver.write_outputs(0, before)


def outputs(harness: Harness, io: IoDriver, expected: bytes, byte: int) -> None:
    def right() -> bool:
        return io.read_outputs(byte, len(expected)) == expected

    harness.until(right, f"outputs from byte {byte} on are {expected.hex()}", 2.0)


def window(io: IoDriver) -> tuple[int, int]:
    """First byte and size of what the checks may write."""
    size = min(3, io.output_bytes)
    return io.output_bytes - size, size


def test_the_images_have_a_size(harness: Harness, io: IoDriver) -> None:
    assert io.input_bytes >= 0
    assert len(io.read_outputs(0, io.output_bytes)) == io.output_bytes
    if io.input_bytes:
        assert len(io.read_inputs(0, io.input_bytes)) == io.input_bytes


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


def test_bytes_leave_their_neighbours_alone(harness: Harness, io: IoDriver) -> None:
    first, size = window(io)
    for index in range(size):
        io.write_outputs(first, bytes([0xA5] * size))
        io.write_outputs(first + index, bytes([0x3C]))
        expected = bytearray([0xA5] * size)
        expected[index] = 0x3C
        outputs(harness, io, bytes(expected), first)


def test_the_other_outputs_stay_as_they_are(harness: Harness, io: IoDriver) -> None:
    first, size = window(io)
    if harness.can(Capability.SIMULATED):
        io.write_outputs(0, bytes([0x5A] * io.output_bytes))
    before = io.read_outputs(0, io.output_bytes)
    io.write_outputs(first, bytes([0xFF] * size))
    outputs(harness, io, bytes([0xFF] * size), first)
    assert io.read_outputs(0, io.output_bytes)[:first] == before[:first]


def test_bits_written_by_several_threads_are_all_there(harness: Harness, io: IoDriver) -> None:
    byte = io.output_bytes - 1
    io.write_outputs(byte, bytes([0]))

    def toggle(bit: int) -> None:
        for round_ in range(21):
            io.write_output_bit(byte, bit, round_ % 2 == 0)

    threads = [threading.Thread(target=toggle, args=(bit,)) for bit in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20.0)
    outputs(harness, io, bytes([0xFF]), byte)


def test_reading_does_not_block(harness: Harness, io: IoDriver) -> None:
    durations = list[float]()
    for _ in range(200):
        with timed(durations):
            io.read_outputs(0, 1)
    assert median(durations) < 0.25 * harness.period_s


def test_an_input_shows_its_sensor(harness: Harness, io: IoDriver, injector: FaultInjector) -> None:
    if io.input_bytes == 0:
        pytest.skip("the device has no inputs")
    for value in (True, False):
        injector.set_input_bit(0, 3, value)
        harness.until(partial(follows, harness, value), "the input follows its sensor")


def follows(harness: Harness, value: bool) -> bool:
    return harness.robot.io.input_bit(0, 3) is value


def test_addresses_outside_are_rejected(harness: Harness, io: IoDriver) -> None:
    for call in (
        lambda: harness.robot.io.set_output_bit(io.output_bytes, 0, True),
        lambda: harness.robot.io.set_output_bit(0, 8, True),
        lambda: harness.robot.io.output_bytes(io.output_bytes - 1, 2),
        lambda: harness.robot.io.input_bytes(-1, 1),
    ):
        with pytest.raises(InvalidArgument):
            call()


def test_outputs_are_at_the_terminals(
    harness: Harness, io: IoDriver, injector: FaultInjector
) -> None:
    first, size = window(io)
    for pattern in (0x00, 0xB1, 0x4E):  # other patterns when the bits are reversed
        io.write_outputs(first, bytes([pattern] * size))
        for bit in range(8):
            level = bool(pattern >> bit & 1)
            harness.until(partial(shows, injector, first, bit, level), "the terminal shows it")


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


def test_nothing_is_written_while_no_device_is_open(unopened: Harness) -> None:
    driver = unopened.drivers.io
    if driver is None or driver.output_bytes == 0:
        pytest.skip("the device has no outputs")
    with pytest.raises(OperationError):
        driver.write_outputs(0, bytes(1))
    with pytest.raises(OperationError):
        driver.write_output_bit(0, 0, False)


def shows(injector: FaultInjector, byte: int, bit: int, level: bool) -> bool:
    return injector.output_bit(byte, bit) is level
