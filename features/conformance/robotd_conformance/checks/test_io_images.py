"""Whole images of inputs and outputs: parts of every length, several changes at once, live."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import suppress
from functools import partial

import pytest

from robotd.api import Capability, FaultInjector, IoDriver, Unsupported
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.test_io import io, outputs, places, shows

__all__ = ["io"]  # the fixture

pytestmark = pytest.mark.needs(Capability.IO)

LENGTHS = (1, 2, 3, 4, 5, 7, 8, 9, 16, 17)
PATTERN = bytes((53 * index + 29) % 251 for index in range(64))
OTHERS = 0x5A


def parts(size: int) -> Iterator[tuple[int, int]]:
    """Yield address and length of parts of an image of ``size`` bytes, odd and even ones."""
    for length in LENGTHS:
        for at in dict.fromkeys((0, 1, 2, 3, 5, 7, 8, size // 2, size - length)):
            if 0 <= at <= size - length:
                yield at, length


@pytest.mark.clause("IoDriver.read_inputs/bytes", "IoDriver.read_outputs/bytes")
def test_parts_of_all_lengths_are_those_of_the_whole(
    harness: Harness, io: IoDriver, injector: FaultInjector
) -> None:
    """A simulation has every second input on and a pattern of outputs."""
    if harness.can(Capability.SIMULATED):
        io.write_outputs(0, (PATTERN * (io.output_bytes // len(PATTERN) + 1))[: io.output_bytes])
    for byte in places(io) if harness.can(Capability.SIMULATED) else ():
        with suppress(Unsupported):  # a gap between two modules
            for bit in range(byte % 2, 8, 2):
                harness.set_input_bit(byte, bit, True)
    harness.periods(5)
    for read, size in ((io.read_inputs, io.input_bytes), (io.read_outputs, io.output_bytes)):
        whole = read(0, size) if size else b""
        for at, length in parts(size):
            part = read(at, length)
            assert part == whole[at : at + length], (
                f"{read.__name__}({at}, {length}) is {part.hex()}, not {whole[at:][:length].hex()}"
            )
    for byte in places(io):
        with suppress(Unsupported):
            for bit in range(byte % 2, 8, 2):
                harness.set_input_bit(byte, bit, False)


@pytest.mark.clause("IoDriver.write_outputs/bytes")
@pytest.mark.needs(Capability.SIMULATED)
def test_writes_of_all_lengths_change_their_bytes_alone(harness: Harness, io: IoDriver) -> None:
    size = io.output_bytes
    for at, length in parts(size):
        io.write_outputs(0, bytes([OTHERS] * size))
        data = PATTERN[:length]
        io.write_outputs(at, data)
        expected = bytes([OTHERS] * at) + data + bytes([OTHERS] * (size - at - length))
        if io.read_outputs(0, size) != expected:
            outputs(harness, io, expected[max(0, at - 8) : at + length + 8], max(0, at - 8))
            assert io.read_outputs(0, size) == expected, f"{length} bytes at {at}"


@pytest.mark.clause("IoDriver.write_output_bit/bit", "IoDriver.write_outputs/bytes")
@pytest.mark.needs(Capability.SIMULATED)
def test_bits_are_written_at_the_address_of_each_module(
    harness: Harness, io: IoDriver, injector: FaultInjector
) -> None:
    """Odd and even ones; the terminal shows it, and the rest of the image stays."""
    size = io.output_bytes
    io.write_outputs(0, bytes([OTHERS] * size))
    expected = bytearray([OTHERS] * size)
    for byte in sorted(
        {0, 1, 3, 4, 7, 8, 9, 15, 16, 17, size // 2 + 1, size - 1} & set(range(size))
    ):
        for bit in (0, 1, 6, 7):
            expected[byte] ^= 1 << bit
            level = bool(expected[byte] >> bit & 1)
            io.write_output_bit(byte, bit, level)
            harness.until(partial(shows, injector, byte, bit, level), f"{byte}.{bit} shows it", 2.0)
        outputs(harness, io, bytes(expected), 0)


@pytest.mark.clause("IoDriver.read_inputs/bytes")
def test_inputs_that_change_together_are_all_shown(
    harness: Harness, io: IoDriver, injector: FaultInjector
) -> None:
    """The first bit of all bytes on, the last ones of all on, the first ones off, and so on."""
    if io.input_bytes == 0:
        pytest.skip("the device has no inputs")
    expected = bytearray(io.read_inputs(0, io.input_bytes))
    before = bytes(expected)
    for bit in (0, 7, 0, 7):
        for byte in places(io):
            value = not expected[byte] >> bit & 1
            try:
                harness.set_input_bit(byte, bit, value)
            except Unsupported:  # a gap between two modules
                continue
            expected[byte] ^= 1 << bit
        shown = partial(is_image, io, bytes(expected))
        harness.until(shown, f"bit {bit} of all bytes has changed, and no other", 2.0)
    assert bytes(expected) == before


def is_image(driver: IoDriver, expected: bytes) -> bool:
    return driver.read_inputs(0, len(expected)) == expected


@pytest.mark.clause("IoDriver.live/images")
def test_live_images_change_though_nobody_reads(harness: Harness, io: IoDriver) -> None:
    """They are all that is looked at: a recording asks for nothing else."""
    if io.live is None:
        pytest.skip("there are no images that are updated in place")
    inputs, written = io.live
    last = io.output_bytes - 1
    for level in (True, False, True):
        if last < len(written):
            io.write_output_bit(last, 2, level)
            harness.until(partial(is_bit, written, last, 2, level), "the output is live", 2.0)
        if harness.fault_injector is None or not len(inputs):
            continue
        try:
            harness.set_input_bit(0, 3, level)
        except Unsupported:
            continue
        harness.until(partial(is_bit, inputs, 0, 3, level), "the input is live", 2.0)
    with suppress(Unsupported):
        harness.set_input_bit(0, 3, False)


def is_bit(image: memoryview, byte: int, bit: int, level: bool) -> bool:
    return bool(image[byte] >> bit & 1) is level


@pytest.mark.clause("IoDriver.write_output_bit/bit", "IoDriver.write_outputs/bytes")
def test_a_byte_is_written_while_bits_beside_it_are(harness: Harness, io: IoDriver) -> None:
    """Two threads write two bytes; each byte keeps its own thread's last value."""
    last = io.output_bytes - 1
    if last == 0:
        pytest.skip("there is one byte of outputs")
    io.write_outputs(last - 1, bytes(2))

    def write_bits() -> None:
        for turn in range(41):
            io.write_output_bit(last, turn % 8, turn % 3 != 0)

    bits = threading.Thread(target=write_bits, name="caller")
    bits.start()
    wrong = 0
    for turn in range(40):
        data = bytes([(7 * turn + 1) % 256])
        io.write_outputs(last - 1, data)
        if harness.stepped:  # else it may take a frame until it is shown
            wrong += io.read_outputs(last - 1, 1) != data
    bits.join(20.0)
    assert not bits.is_alive(), "a write of a bit has not come back"
    assert not wrong, f"{wrong} of 40 bytes were overwritten by bits beside them"
    level = sum(bit_at_the_end(bit) << bit for bit in range(8))
    outputs(harness, io, bytes([(7 * 39 + 1) % 256, level]), last - 1)


def bit_at_the_end(bit: int) -> bool:
    """Return what the last turn of ``bit`` among 41 has written."""
    return max(turn for turn in range(41) if turn % 8 == bit) % 3 != 0
