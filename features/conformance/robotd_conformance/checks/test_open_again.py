"""An open device that is opened or started again: everything stays as it is, I/O included."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial

import pytest

from robotd.api import Capability, CommandMode, ConnectionState, IoDriver, RobotdError, Unsupported
from robotd.api.robots import Jog
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.kit_target import KitTarget
from robotd_conformance.checks.recorded_motion import mean_velocity
from robotd_conformance.checks.test_io import io_of, is_live, output_is, outputs, window
from robotd_conformance.checks.test_questions import shown

SHARE = 0.3
ALARM = 0x2310
PATTERNS = (0x00, 0xA5, 0x5A)


@pytest.fixture
def io(fresh: Harness) -> Iterator[IoDriver]:
    """I/O of a harness of its own; its outputs are put back."""
    driver = io_of(fresh)
    before = driver.read_outputs(0, driver.output_bytes)
    yield driver
    with suppress(RobotdError):  # the check may have failed on a closed device
        driver.write_outputs(0, before)


@pytest.mark.clause("backend/makes", "DeviceDriver.open/connects")
def test_each_device_is_made_anew(fresh: Harness, target: KitTarget) -> None:
    """While another one communicates, as in a program that tries a second robot."""
    context = target.backend.context(target.descriptor, fresh.clock)
    other, own = target.backend.drivers(context).device, fresh.drivers.device
    assert vars(other)["wrapped"] is not vars(own)["wrapped"], (
        "the hook has returned a device that is open"
    )
    assert other.state() is ConnectionState.IDLE
    fresh.periods(5)
    assert fresh.robot.connection.ready


def call_again(harness: Harness) -> Iterator[tuple[str, Callable[[], None]]]:
    """Yield the calls that have no effect on a device that communicates, with their names."""
    device = harness.drivers.device
    yield "open()", device.open
    yield "start_communication()", lambda: device.start_communication(5.0)


@pytest.mark.clause("DeviceDriver.open/again", "DeviceDriver.start_communication/again")
def test_a_device_that_is_open_keeps_its_outputs(fresh: Harness, io: IoDriver) -> None:
    first, size = window(io)
    for pattern in PATTERNS:
        written = bytes((pattern + 3 * index) % 256 for index in range(size))
        io.write_outputs(first, written)
        outputs(fresh, io, written, first)
        for name, call in call_again(fresh):
            call()
            fresh.periods(5)
            now = io.read_outputs(first, size)
            assert now == written, f"{name} changes outputs {written.hex()} to {now.hex()}"


@pytest.mark.clause("DeviceDriver.open/again", "DeviceDriver.start_communication/again")
def test_a_device_that_is_open_keeps_alarm_mode_and_counters(fresh: Harness) -> None:
    """An axis in alarm, one in velocity mode, one that is off, and counters of lost frames."""
    last, bus = fresh.count - 1, fresh.drivers.fieldbus
    with suppress(Unsupported):
        if fresh.fault_injector is not None:
            fresh.fault_injector.lose_packets(3)
    fresh.until(lambda: fresh.robot.connection.ready, "values arrive again")
    fresh.robot.axes.servo(last, False)
    if fresh.can(Capability.VELOCITY_MODE) and fresh.count > 2:
        fresh.robot.axes.set_command_mode(1, CommandMode.VELOCITY)
    if fresh.fault_injector is not None:
        with suppress(Unsupported):
            fresh.fault_injector.trip(0, ALARM)
            fresh.until(lambda: bool(fresh.image.amp_alarm[0]), "the alarm is shown", 1.0)
    fresh.pass_time(0.1)
    before = shown(fresh)
    lost = bus.status(0).lost_frames if bus is not None else 0
    for name, call in call_again(fresh):
        call()
        fresh.periods(5)
        now = shown(fresh)
        changed = [key for key, value in before.items() if now[key] != value]
        assert not changed, f"{name} changes {', '.join(changed)}"
        assert bus is None or bus.status(0).lost_frames >= lost, f"{name} resets the counters"


@pytest.mark.clause("DeviceDriver.open/again", "DeviceDriver.start_communication/again")
def test_a_device_that_is_open_goes_on_with_all_commands(fresh: Harness) -> None:
    """A velocity command of the first axis and a move of the last go on."""
    last, speeds = fresh.count - 1, fresh.speeds(SHARE)
    targets = fresh.image.position_command + fresh.travel()
    jogged = fresh.can(Capability.VELOCITY_MODE) and last > 0
    for name, call in call_again(fresh):
        fresh.move([last], targets, [fresh.profile(axis, SHARE) for axis in fresh.all])
        if jogged:
            fresh.robot.axes.set_command_mode(0, CommandMode.VELOCITY)
            fresh.robot.axes.jog([jog_of(fresh, 0, speeds[0])])
            fresh.pass_time(0.25)
        call()
        if jogged:
            velocity = mean_velocity(fresh)[0]
            assert velocity == pytest.approx(speeds[0], rel=0.1, abs=0.02), f"{name}: velocity"
            fresh.robot.axes.jog([jog_of(fresh, 0, 0.0)])
        fresh.rest()
        assert not fresh.off_target(targets, [last]), name
        assert fresh.drivers.device.state() is ConnectionState.COMMUNICATING
        targets -= fresh.travel()
        speeds = -speeds


@pytest.mark.needs(Capability.IO)
@pytest.mark.clause("IoDriver.live/same", "IoDriver.live/images")
def test_the_live_images_are_the_same_for_ever(fresh: Harness, io: IoDriver) -> None:
    """Those taken before anything, in a second and a third connection."""
    if io.live is None:
        pytest.skip("there are no images that are updated in place")
    images = io.live
    ends = (fresh.robot.connection.close, fresh.robot.connection.stop_communication)
    for pattern, end in zip(PATTERNS[1:], ends, strict=True):
        end()
        fresh.start(enable=False)
        watch_live(fresh, io, images, pattern)


def watch_live(
    harness: Harness, io: IoDriver, images: tuple[memoryview, memoryview], pattern: int
) -> None:
    """Change outputs, and an input where there is a sensor; ``images`` have to show it."""
    last = min(io.output_bytes, len(images[1])) - 1
    if harness.can(Capability.SIMULATED) or last == io.output_bytes - 1:
        io.write_outputs(last, bytes([pattern]))
        shows = partial(shows_byte, images[1], last, pattern)
        harness.until(shows, f"the live image shows output byte {last}", 2.0)
    if io.input_bytes == 0:
        return
    value = not io.read_inputs(0, 1)[0] >> 3 & 1
    with suppress(Unsupported):
        harness.set_input_bit(0, 3, value)
    everything = partial(io.read_inputs, 0, io.input_bytes)
    harness.until(lambda: is_live(images[0], everything()), "the live image shows the inputs", 2.0)


def shows_byte(image: memoryview, byte: int, value: int) -> bool:
    return image[byte] == value


@pytest.mark.needs(Capability.IO)
@pytest.mark.clause("IoDriver/reads")
def test_io_answers_in_every_state(unopened: Harness) -> None:
    """Whole images, of the sizes that they have; and bits are written after each start."""
    driver, device = io_of(unopened), unopened.drivers.device
    unopened.begin()
    sizes, byte = (driver.input_bytes, driver.output_bytes), driver.output_bytes - 1
    steps: list[Callable[[], object]] = [
        device.state,
        unopened.open,
        lambda: device.start_communication(10.0),
        lambda: device.stop_communication(10.0),
        lambda: device.start_communication(10.0),
        device.close,
    ]
    for step in steps:
        step()
        assert (driver.input_bytes, driver.output_bytes) == sizes
        assert len(driver.read_inputs(0, sizes[0])) == sizes[0]
        assert len(driver.read_outputs(0, sizes[1])) == sizes[1]
        if device.state() is ConnectionState.COMMUNICATING:
            was = bool(driver.read_outputs(byte, 1)[0] & 1)
            for value in (not was, was):
                driver.write_output_bit(byte, 0, value)
                unopened.until(partial(output_is, driver, byte, 0, value), "the output obeys", 2.0)


def jog_of(harness: Harness, axis: int, velocity: float) -> Jog:
    """A velocity command of one axis."""
    return Jog(axis, replace(harness.profile(axis), velocity=float(velocity)))
