"""Late effects: for some time after a call nothing changes that it has not changed at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from robotd.api import (
    Capability,
    CommandMode,
    FaultInjector,
    NotReady,
    Operation,
    ProcessImage,
    RobotdError,
)
from robotd_conformance.checks.harness import SETTLE_S, SETTLED_RAD, Harness
from robotd_conformance.checks.test_fieldbus import HARMLESS, fieldbus_of, lost_frames
from robotd_conformance.checks.test_questions import rewrite
from robotd_conformance.checks.test_scaling import COUNTS, TURN

WATCH_S = 0.4  # after the effects of a call
SHOWN_PERIODS = 5  # until the image shows what a call has done
ALARM = 0x32
MOVED_RAD = 2.0 * SETTLED_RAD
STATES = (
    "servo_on", "home_done", "mode", "operation", "motion_complete", "amp_alarm", "alarm_code",
    "offline",
)  # fmt: skip
POSITIONS = ("position", "position_command")


def watch(
    harness: Harness,
    call: str,
    *,
    may_change: Sequence[str] = (),
    command: Callable[[], None] = lambda: None,
) -> None:
    """Fail where what the device shows changes while no other call is made.

    Args:
        call: what has been called last, with its axis.
        may_change: names of states that may.
        command: called in each period.
    """
    problems, before = dict[tuple[str, int], str](), dict[str, npt.NDArray[Any]]()
    names = [name for name in (*STATES, *POSITIONS) if name not in may_change]
    began_ns = 0

    def look(image: ProcessImage) -> None:
        command()
        if not began_ns:
            return
        if not before:
            before.update({name: getattr(image, name).copy() for name in names})
        for name, old in before.items():
            new = getattr(image, name)
            if name in STATES:
                changed = new != old
            else:
                changed = ~(np.abs(new - old) <= MOVED_RAD) & ~(np.isnan(new) & np.isnan(old))
            for axis in np.flatnonzero(changed).tolist():
                after_s = (harness.clock.now_ns() - began_ns) * 1e-9
                problems.setdefault(
                    (name, axis),
                    f"axis {axis}: {name} {new[axis]:.6g}, was {old[axis]:.6g} until"
                    f" {after_s:.3f} s after the effects of {call}",
                )

    with harness.each_period(look):
        harness.periods(SHOWN_PERIODS)
        harness.pass_time(SETTLE_S)
        outputs, dumped = outputs_of(harness), dumps(harness)
        began_ns = harness.clock.now_ns()
        harness.pass_time(WATCH_S)
    assert not problems, f"{'; '.join(problems.values())}; nothing may change within {WATCH_S:g} s"
    within = f"within {WATCH_S:g} s after {call}"
    assert outputs_of(harness) == outputs, f"outputs changed {within}"
    changed = [axis for axis, text in enumerate(dumps(harness)) if text != dumped[axis]]
    assert not changed, f"parameters of axes {changed} changed {within}"


def outputs_of(harness: Harness) -> bytes:
    """Return the output image; empty where there is none."""
    io = harness.drivers.io
    return io.read_outputs(0, io.output_bytes) if io is not None and io.output_bytes else b""


def dumps(harness: Harness) -> list[str]:
    """Return the parameters in force, by axis; empty where the device takes no file.

    "" for what cannot be dumped, which other checks judge.
    """
    if not harness.can(Capability.PARAMETERS_FILE):
        return []
    texts = [""] * harness.count
    for axis in harness.all:
        with suppress(RobotdError):
            texts[axis] = harness.drivers.device.dump_parameters(axis)
    return texts


@pytest.mark.clause("AxisDriver.servo/enabled", "AxisDriver.clear_alarm/idle")
@pytest.mark.clause("AxisDriver.end_stream/idle", "DeviceDriver.start_communication/again")
@pytest.mark.clause("AxisDriver.stop/idle", "AxisDriver.quick_stop/idle")
@pytest.mark.clause("DeviceDriver.open/again", "AxisDriver/resumption", "AxisDriver/others")
def test_what_has_no_effect_has_none_later(harness: Harness) -> None:
    """Axes at rest that are on, without an alarm and a stream, on a device that communicates."""
    driver, device = harness.drivers.axes, harness.drivers.device
    for axis in {0, harness.count - 1}:
        driver.servo(axis, True, 5.0)
        watch(harness, f"servo on of axis {axis}, which is on")
        driver.clear_alarm(axis, 5.0)
        watch(harness, f"clear_alarm of axis {axis} without an alarm")
    driver.end_stream(harness.all)
    watch(harness, "end_stream without a stream")
    driver.stop(harness.all)
    watch(harness, "a stop at rest")
    driver.quick_stop(harness.all)
    watch(harness, "a quick stop at rest")
    device.start_communication(5.0)
    watch(harness, "start_communication of a device that communicates")
    device.open()
    watch(harness, "open of a device that is open")


@pytest.mark.clause("AxisDriver.servo/switches", "AxisDriver.servo/disables", "AxisDriver/servos")
@pytest.mark.clause("AxisDriver.servo/no-jump", "AxisDriver/others", "AxisDriver/takes-away")
def test_a_servo_stays_as_it_was_switched(harness: Harness) -> None:
    driver = harness.drivers.axes
    for axis in {0, harness.count - 1}:
        for on in (False, True):
            driver.servo(axis, on, 5.0)
            watch(harness, f"servo {'on' if on else 'off'} of axis {axis}")


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.set_command_mode/changes", "AxisDriver.read/mode")
@pytest.mark.clause("AxisDriver.set_command_mode/nothing-moves")
def test_a_mode_stays_as_it_was_set(harness: Harness) -> None:
    for axis in {0, harness.count - 1}:
        for mode in (CommandMode.VELOCITY, CommandMode.POSITION):
            harness.drivers.axes.set_command_mode(axis, mode)
            watch(harness, f"set_command_mode of axis {axis} to {mode.name}")


@pytest.mark.clause("AxisDriver/as-commanded", "AxisDriver/others")
@pytest.mark.clause("AxisDriver.move/while-stopping", "AxisDriver.stop/again")
@pytest.mark.clause("AxisDriver.quick_stop/takes-over")
def test_motion_that_has_ended_does_not_begin_again(harness: Harness) -> None:
    driver, start = harness.drivers.axes, harness.image.position_command.copy()
    first = start.copy()
    first[0] += harness.travel(0.5)[0]
    harness.move([0], first)
    harness.rest()
    watch(harness, "a move of axis 0")
    stops: dict[str, Callable[[], object]] = {
        "a stop": lambda: None,
        "a second stop": lambda: driver.stop(harness.all),
        "a quick stop during a stop": lambda: driver.quick_stop(harness.all),
        "moves during a stop": lambda: harness.move(harness.all, start),
    }
    for name, then in stops.items():
        harness.move_all(0.5)
        harness.pass_time(0.1)
        driver.stop(harness.all)
        harness.periods(1)
        with suppress(RobotdError):
            then()
        harness.rest()
        watch(harness, name)
        harness.return_to_start()


@pytest.mark.clause("AxisDriver.begin_stream/waits", "AxisDriver.end_stream/moves")
def test_a_stream_without_setpoints_does_not_move_later(streamed: Harness) -> None:
    """A device may stop it then, as one that has run out of setpoints."""
    driver, every = streamed.drivers.axes, streamed.all
    driver.begin_stream(every)
    watch(streamed, "begin_stream", may_change=("operation", "motion_complete"))
    driver.end_stream(every)
    targets = streamed.move_all()
    streamed.rest()
    assert not streamed.off_target(targets)


@pytest.mark.clause("AxisDriver.begin_stream/operation", "AxisDriver.begin_stream/again")
@pytest.mark.clause("AxisDriver.begin_stream/follows", "AxisDriver.end_stream/holds")
def test_a_stream_goes_on_until_it_is_ended(streamed: Harness) -> None:
    driver, every = streamed.drivers.axes, streamed.all
    here, still = streamed.image.position_command.copy(), np.zeros(streamed.count)

    def hold() -> None:
        streamed.stream(here, still)

    driver.begin_stream(every)
    watch(streamed, "begin_stream", command=hold)
    assert (streamed.image.operation == Operation.STREAM).all(), "not in Operation.STREAM"
    with suppress(NotReady):  # may be rejected
        driver.begin_stream(every)
    watch(streamed, "begin_stream of axes that stream", command=hold)
    driver.end_stream(every)
    watch(streamed, "end_stream")


@pytest.mark.clause("AxisDriver.clear_alarm/clears", "AxisDriver/resumption", "AxisDriver/servos")
def test_a_cleared_alarm_does_not_come_back(harness: Harness, injector: FaultInjector) -> None:
    for axis in {0, harness.count - 1}:
        injector.trip(axis, ALARM)
        harness.until(lambda axis=axis: bool(harness.image.amp_alarm[axis]), "an alarm", 1.0)  # type: ignore[misc]
        harness.drivers.axes.clear_alarm(axis, 5.0)
        watch(harness, f"clear_alarm of axis {axis}")


@pytest.mark.clause("DeviceDriver.start_communication/nothing-moves", "AxisDriver/servos")
@pytest.mark.clause("DeviceDriver.start_communication/resumes", "AxisDriver/resumption")
def test_a_start_has_no_later_effects(fresh: Harness) -> None:
    """After a move and a pause of communication."""
    fresh.move_all(0.5)
    fresh.rest()
    connection = fresh.robot.connection
    connection.stop_communication()
    fresh.start(enable=False)
    watch(fresh, "start_communication")


@pytest.mark.needs(Capability.HOMING)
@pytest.mark.clause("AxisDriver.home/zero", "AxisDriver.home/no-motion", "AxisDriver.home/scale")
def test_an_axis_stays_where_it_was_homed(fresh: Harness) -> None:
    fresh.require_rescaling()
    fresh.move_all(0.3)
    fresh.rest()
    for axis in {0, fresh.count - 1}:
        fresh.robot.axes.home(axis)
        watch(fresh, f"home of axis {axis}")


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.set_polarity/sets", "AxisDriver.set_polarity/measured")
@pytest.mark.clause("AxisDriver.set_polarity/ratio", "AxisDriver.set_gear_ratio/counts")
@pytest.mark.clause("AxisDriver.set_gear_ratio/polarity")
def test_a_scale_stays_as_it_was_set(rescalable: Harness) -> None:
    axes = rescalable.robot.axes
    for axis in {0, rescalable.count - 1}:
        for polarity in (-1, 1):
            axes.set_polarity(axis, polarity)
            watch(rescalable, f"set_polarity of axis {axis} to {polarity}")
        axes.set_gear_ratio(axis, 2.0 * COUNTS, TURN)
        watch(rescalable, f"set_gear_ratio of axis {axis}")


@pytest.mark.needs(Capability.IO)
@pytest.mark.clause("IoDriver.write_outputs/bytes", "IoDriver.write_output_bit/bit")
def test_outputs_stay_as_they_were_written(harness: Harness) -> None:
    io = harness.drivers.io
    if io is None or not io.output_bytes:
        pytest.skip("the device has no outputs")
    last = io.output_bytes - 1
    before = io.read_outputs(last, 1)
    try:
        io.write_outputs(last, b"\x5a")
        watch(harness, f"write_outputs of byte {last}")
        io.write_output_bit(last, 0, True)
        watch(harness, f"write_output_bit of byte {last}")
    finally:
        io.write_outputs(last, before)


@pytest.mark.needs(Capability.FIELDBUS)
@pytest.mark.clause("FieldbusDriver.write_object/nothing-moves")
@pytest.mark.clause("FieldbusDriver.reset_statistics/zero")
def test_the_fieldbus_does_nothing_later(harness: Harness) -> None:
    bus = fieldbus_of(harness)
    if harness.can(Capability.STATISTICS):
        bus.reset_statistics(0)
        lost = lost_frames(harness)
        watch(harness, "reset_statistics")
        # A bus may lose frames of its own, on a busy computer.
        if harness.stepped:
            assert lost_frames(harness) == lost, f"counters changed within {WATCH_S:g} s"
    if harness.can(Capability.OBJECTS):
        for node in bus.node_ids(0):
            with suppress(RobotdError):
                rewrite(bus, node, HARMLESS[0])
        watch(harness, "write_object")
