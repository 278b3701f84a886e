"""Objects and registers of the nodes: each read is new, and each byte in its place."""

from __future__ import annotations

import threading
from contextlib import suppress

import numpy as np
import pytest

from robotd.api import (
    Capability,
    CommandMode,
    FaultInjector,
    FieldbusDriver,
    OperationError,
    RobotdError,
)
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.test_fieldbus import (
    DEVICE_TYPE,
    HARMLESS,
    IDENTITY,
    fieldbus_of,
)

pytestmark = pytest.mark.needs(Capability.FIELDBUS)

ERROR_CODE, STATUSWORD, MODE, POSITION = 0x603F, 0x6041, 0x6061, 0x6064  # of CiA 402
NAME = 0x1008  # manufacturer's device name, a text of any length (CiA 301)
AXIS_STEP = 0x800  # from an object of one axis of a drive to that of the next (CiA 402-1)
STATE, ENABLED = 0x6F, 0x27  # bits of a statusword, and their values with operation enabled
ALARM = 0x2310  # its two bytes differ
REGISTERS = 0x14  # of a slave controller, from its start: type and addresses, all constant
READS = 25  # by each of several threads
CYCLIC = {8: 1, 9: 3, 10: 4}  # modes of CiA 402, and those of the kind with the drive's profile
AXIS = tuple[int, int, int]  # bus, node, and place of the axis in its drive


def drive_axes(bus: FieldbusDriver, index: int) -> list[AXIS]:
    """Return the axes of all drives that have the object ``index``; without one, skip the check."""
    found = []
    for number in range(bus.buses):
        for node in bus.status(number).nodes:
            for place in range(node.axes):
                with suppress(OperationError):
                    bus.read_object(number, node.id, index + place * AXIS_STEP, 0)
                    found.append((number, node.id, place))
    if not found:
        pytest.skip(f"no node has the object 0x{index:X}")
    return found


def read_words(bus: FieldbusDriver, axes: list[AXIS], index: int, size: int) -> list[int]:
    """Read an object of each axis; the integers, signed from 4 bytes on."""
    values = []
    for number, node, place in axes:
        data = bus.read_object(number, node, index + place * AXIS_STEP, 0)
        assert len(data) == size, f"0x{index:X} of node {node} has {len(data)} bytes, not {size}"
        values.append(int.from_bytes(data, "little", signed=size > 2))
    return values


@pytest.mark.needs(Capability.OBJECTS)
@pytest.mark.clause("FieldbusDriver.read_object/value", "FieldbusDriver.read_object/now")
def test_a_statusword_shows_whether_its_axis_is_on(harness: Harness) -> None:
    """Checks every drive with one axis after the other off; bytes are in order."""
    bus = fieldbus_of(harness)
    axes = drive_axes(bus, STATUSWORD)
    for axis in harness.all:
        off = len(harness.servo_group(axis))
        for on, expected in ((True, 0), (False, off), (True, 0)):
            harness.robot.axes.servo(axis, on)
            harness.periods(5)
            words = read_words(bus, axes, STATUSWORD, 2)
            found = sum(word & STATE != ENABLED for word in words)
            assert found == expected, (
                f"servo {'on' if on else 'off'} of axis {axis}: statuswords"
                f" {', '.join(f'0x{word:04X}' for word in words)}, {expected} shall not be enabled"
            )


@pytest.mark.needs(Capability.OBJECTS)
@pytest.mark.clause("FieldbusDriver.read_object/value", "FieldbusDriver.read_object/now")
def test_a_position_object_follows_its_axis(harness: Harness) -> None:
    """Read at rest, in motion and at rest again; counts change as the positions, out and back."""
    bus = fieldbus_of(harness)
    axes = drive_axes(bus, POSITION)
    counts, places = [read_words(bus, axes, POSITION, 4)], [harness.image.position.copy()]
    for share in (1.0, -0.4):
        harness.move_all(share)
        harness.pass_time(0.15)
        moving = read_words(bus, axes, POSITION, 4)
        harness.rest()
        counts.append(read_words(bus, axes, POSITION, 4))
        places.append(harness.image.position.copy())
        stuck = [
            axis for axis, was, now in zip(axes, moving, counts[-1], strict=True) if was == now
        ]
        assert not stuck, f"0x6064 of node {stuck[0][1]} is the same in motion and at rest"
    distances = np.diff(places, axis=0)
    for axis, (first, middle, last) in zip(axes, zip(*counts, strict=True), strict=True):
        ratio = wrapped(last - middle) / (wrapped(middle - first) or 1)
        right = (distances[1] / distances[0]).mean()
        assert ratio == pytest.approx(right, abs=0.05), (
            f"0x6064 of node {axis[1]} went {first}, {middle}, {last}: not as its axis"
        )


def wrapped(counts: int) -> int:
    """Return a difference of counts of 32 bits."""
    return (counts + (1 << 31)) % (1 << 32) - (1 << 31)


@pytest.mark.needs(Capability.OBJECTS)
@pytest.mark.clause("FieldbusDriver.read_object/value", "FieldbusDriver.read_object/now")
def test_an_error_object_has_the_code_of_the_alarm(
    harness: Harness, injector: FaultInjector
) -> None:
    """Twice, with two codes, and 0 between."""
    bus = fieldbus_of(harness)
    axes = drive_axes(bus, ERROR_CODE)
    for code in (ALARM, 0x7305):
        before = read_words(bus, axes, ERROR_CODE, 2)
        assert not any(before), f"0x603F is {max(before):#x} without an alarm"
        injector.trip(0, code)
        harness.until(lambda: bool(harness.image.amp_alarm[0]), "the alarm is shown", 1.0)
        shown = [value for value in read_words(bus, axes, ERROR_CODE, 2) if value]
        assert shown == [code] * len(harness.alarm_group(0)), (
            f"0x603F is {', '.join(f'0x{value:04X}' for value in shown) or 0} in alarm 0x{code:04X}"
        )
        harness.robot.axes.clear_alarm(0)
        harness.periods(5)
    harness.enable()


@pytest.mark.needs(Capability.OBJECTS)
@pytest.mark.clause("FieldbusDriver.read_object/errors", "FieldbusDriver.write_object/errors")
def test_a_missing_subindex_and_a_constant_are_errors_each_time(harness: Harness) -> None:
    bus = fieldbus_of(harness)
    for number in range(bus.buses):
        for node in bus.node_ids(number):
            before = bus.read_object(number, node, DEVICE_TYPE, 0)
            for _ in range(2):
                with pytest.raises(OperationError):
                    bus.read_object(number, node, IDENTITY, 0x7F)
                with pytest.raises(OperationError):
                    bus.write_object(number, node, DEVICE_TYPE, 0, bytes(reversed(before)))
            assert bus.read_object(number, node, DEVICE_TYPE, 0) == before


@pytest.mark.needs(Capability.OBJECTS)
@pytest.mark.clause("FieldbusDriver.read_object/value", "FieldbusDriver.read_object/now")
def test_a_mode_object_shows_the_mode_of_its_axis(harness: Harness) -> None:
    """One byte, of one axis after the other: another one in velocity mode, then as before."""
    if not harness.can(Capability.VELOCITY_MODE):
        pytest.skip("there is one mode")
    bus = fieldbus_of(harness)
    axes = drive_axes(bus, MODE)
    before = read_words(bus, axes, MODE, 1)
    for axis in harness.all:
        for mode, expected in ((CommandMode.VELOCITY, 1), (CommandMode.POSITION, 0)):
            harness.robot.axes.set_command_mode(axis, mode)
            harness.periods(5)
            now = read_words(bus, axes, MODE, 1)
            other = sum(
                CYCLIC.get(one, one) != CYCLIC.get(was, was)
                for one, was in zip(now, before, strict=True)
            )
            assert other == expected, (
                f"axis {axis} in {mode.name.lower()} mode: 0x6061 went from {before} to {now}"
            )


@pytest.mark.needs(Capability.OBJECTS)
@pytest.mark.clause("FieldbusDriver.write_object/writes")
def test_objects_of_each_size_are_written_beside_each_other(harness: Harness) -> None:
    """All harmless ones of the first and the last drive, each twice; then all are as before."""
    bus = fieldbus_of(harness)
    drives = [node.id for node in bus.status(0).nodes if node.axes]
    places = [
        (node, index) for node in dict.fromkeys((drives[0], drives[-1])) for index in HARMLESS
    ]
    before = dict[tuple[int, int], bytes]()
    for node, index in places:
        with suppress(OperationError):
            before[node, index] = bus.read_object(0, node, index, 0)
    if not before:
        pytest.skip("no node has an object that may be written")
    for mask in (0x2B, 0x64):
        expected = {
            place: bytes(byte ^ (mask + at + place[1]) % 256 for at, byte in enumerate(data))
            for place, data in before.items()
        }
        for (node, index), data in expected.items():
            bus.write_object(0, node, index, 0, data)
        for (node, index), data in expected.items():
            now = bus.read_object(0, node, index, 0)
            assert now == data, f"0x{index:X} of node {node} is {now.hex()}, not {data.hex()}"
    for (node, index), data in before.items():
        bus.write_object(0, node, index, 0, data)
        assert bus.read_object(0, node, index, 0) == data


@pytest.mark.needs(Capability.OBJECTS)
@pytest.mark.clause("FieldbusDriver.read_object/value")
def test_names_of_nodes_are_read_to_their_end(harness: Harness) -> None:
    """A text of one length at every kind of node, as long as an integer, is one that was cut."""
    bus, names = fieldbus_of(harness), set[bytes]()
    for number in range(bus.buses):
        for node in bus.node_ids(number):
            with suppress(OperationError):
                names.add(bus.read_object(number, node, NAME, 0))
    if not names:
        pytest.skip("no node tells its name")
    for name in names:
        text = name.rstrip(b"\0")
        assert text.isascii(), f"0x1008 is {name!r}"
        assert text.decode().isprintable(), f"0x1008 is {name!r}"
    sizes = {len(name) for name in names}
    assert sizes not in ({1}, {2}, {4}, {8}), f"every name has {sizes.pop()} bytes: {names}"


@pytest.mark.needs(Capability.OBJECTS)
@pytest.mark.clause("FieldbusDriver.read_object/value", "drivers/threads")
def test_objects_that_several_threads_read_are_not_mixed(harness: Harness) -> None:
    """Each thread reads an object of its own node and index again and again."""
    bus = fieldbus_of(harness)
    nodes = bus.node_ids(0)
    own = [(nodes[0], DEVICE_TYPE, 0), (nodes[-1], IDENTITY, 0), (nodes[-1], DEVICE_TYPE, 0)]
    expected = [bus.read_object(0, *address) for address in own]
    wrong, errors = list[str](), list[Exception]()

    def read(which: int) -> None:
        node, index, subindex = own[which]
        try:
            for _ in range(READS):
                data = bus.read_object(0, node, index, subindex)
                if data != expected[which]:
                    wrong.append(f"0x{index:X} of node {node} is {data.hex()}")
        except Exception as error:  # noqa: BLE001 - the check looks at it
            errors.append(error)

    threads = [threading.Thread(target=read, args=(which,), name="caller") for which in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20.0)
    assert not any(thread.is_alive() for thread in threads), "a read has not come back"
    assert not errors
    assert not wrong, f"{len(wrong)} objects are those of another thread: {wrong[0]}"


@pytest.mark.needs(Capability.REGISTER_READ)
@pytest.mark.clause("FieldbusDriver.read_register/memory")
def test_registers_are_the_same_in_parts_of_all_sizes(harness: Harness) -> None:
    """Constant ones, of the first and the last node: each byte alone, and from every address."""
    bus = fieldbus_of(harness)
    nodes = bus.node_ids(0)
    for node in dict.fromkeys((nodes[0], nodes[-1])):
        whole = bus.read_register(0, node, 0, REGISTERS)
        single = b"".join(bus.read_register(0, node, at, 1) for at in range(REGISTERS))
        assert single == whole, f"node {node}: {single.hex()} byte by byte, {whole.hex()} at once"
        for length in (2, 3, 4, 7, 16):
            for at in range(REGISTERS - length + 1):
                part = bus.read_register(0, node, at, length)
                assert part == whole[at : at + length], (
                    f"node {node}: {length} bytes from {at:#x} are {part.hex()},"
                    f" not {whole[at : at + length].hex()}"
                )


@pytest.mark.needs(Capability.REGISTER_READ)
@pytest.mark.clause("FieldbusDriver.read_register/now")
def test_registers_show_that_the_exchange_has_ended(fresh: Harness) -> None:
    """Some register of a node tells its state, or what it measures: reading remembers nothing."""
    bus, device = fieldbus_of(fresh), fresh.drivers.device
    node = bus.node_ids(0)[0]

    def memory() -> bytes:
        size = min(bus.register_bytes, 0x1000)
        return b"".join(bus.read_register(0, node, at, 64) for at in range(0, size - 63, 64))

    before = memory()
    device.stop_communication(10.0)
    fresh.pass_time(0.1)
    with suppress(RobotdError):  # a node may answer only while it communicates
        assert memory() != before, "all registers are those of the exchange that has ended"
