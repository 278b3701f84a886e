"""Queries have no side effects: motion, states and outputs stay as they were."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial

import numpy as np
import pytest

from robotd.api import Capability, FaultInjector, FieldbusDriver, RobotdError
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import judge
from robotd_conformance.checks.test_fieldbus import HARMLESS
from robotd_conformance.checks.test_profiles import MORE
from robotd_conformance.checks.test_ramps import SPAN_S

ROUNDS = 3


def questions(harness: Harness) -> Iterator[Callable[[], object]]:
    """Yield every call of the drivers that only asks."""
    drivers = harness.drivers
    yield drivers.device.state
    yield drivers.device.fault
    yield drivers.device.scan_network
    yield lambda: drivers.axes.device_limits
    if harness.can(Capability.PARAMETERS_FILE):
        for axis in harness.all:
            yield lambda axis=axis: drivers.device.dump_parameters(axis)  # type: ignore[misc]
    io = drivers.io
    if io is not None:
        yield lambda: io.read_inputs(0, io.input_bytes)
        yield lambda: io.read_outputs(0, io.output_bytes)
    bus = drivers.fieldbus
    if bus is None:
        return
    yield lambda: bus.status(0)
    for node in bus.node_ids(0):
        if harness.can(Capability.REGISTER_READ):
            yield lambda node=node: bus.read_register(0, node, 0, 8)  # type: ignore[misc]
        if harness.can(Capability.OBJECTS):
            yield lambda node=node: bus.read_object(0, node, 0x1018, 1)  # type: ignore[misc]


def shown(harness: Harness) -> dict[str, object]:
    """Return the states that no question may change."""
    image = harness.image
    names = ("servo_on", "home_done", "mode", "amp_alarm", "alarm_code", "offline")
    state = {name: getattr(image, name).tolist() for name in names}
    io = harness.drivers.io
    return state | ({"outputs": io.read_outputs(0, io.output_bytes)} if io else {})


@pytest.mark.clause("DeviceDriver.state/now", "DeviceDriver.fault/reason")
@pytest.mark.clause("DeviceDriver.scan_network/summary", "DeviceDriver.dump_parameters/text")
@pytest.mark.clause("IoDriver.read_inputs/bytes", "IoDriver.read_outputs/bytes")
@pytest.mark.clause("FieldbusDriver.status/status", "FieldbusDriver.read_register/memory")
@pytest.mark.clause("FieldbusDriver.read_object/value", "AxisDriver.device_limits/limits")
def test_questions_change_nothing(harness: Harness) -> None:
    before, targets = shown(harness), harness.image.position_command + harness.travel()
    fastest = np.array([harness.profile(axis).velocity for axis in harness.all])
    with harness.recording() as recording:
        harness.move(harness.all, targets)
        for ask in [*questions(harness)] * ROUNDS:
            with suppress(RobotdError):
                ask()
            harness.periods(1)
        harness.rest()
    assert not harness.off_target(targets)
    assert shown(harness) == before
    assert harness.image.motion_complete.all()
    _, speeds = recording.slope(recording.position, SPAN_S)
    beyond = np.flatnonzero(np.abs(speeds).max(0) > MORE * fastest + SETTLED_RAD / SPAN_S)
    judge(harness, recording, [f"axis {axis} was disturbed by a question" for axis in beyond])


@pytest.mark.clause(
    "DeviceDriver.state/now", "FieldbusDriver.status/status", "AxisDriver.read/fills"
)
def test_questions_clear_no_alarm(harness: Harness, injector: FaultInjector) -> None:
    harness.trip(0x32)
    harness.periods(5)  # the drive switches off after it has shown its alarm
    before = shown(harness)
    for ask in [*questions(harness)] * ROUNDS:
        with suppress(RobotdError):
            ask()
    harness.periods(5)
    assert shown(harness) == before


@pytest.mark.clause("FieldbusDriver.write_object/nothing-moves")
@pytest.mark.clause(
    "FieldbusDriver.reset_statistics/zero", "FieldbusDriver.start_hot_connect/joins"
)
@pytest.mark.clause("IoDriver.write_outputs/bytes", "IoDriver.write_output_bit/bit")
def test_what_does_not_concern_an_axis_leaves_it_alone(harness: Harness) -> None:
    """Outputs, objects, counters and a hot connect, while all axes move."""
    io, bus = harness.drivers.io, harness.drivers.fieldbus
    works: list[Callable[[], object]] = []
    if io is not None and io.output_bytes:
        last = io.output_bytes - 1
        before = io.read_outputs(last, 1)
        works += [
            lambda: io.write_outputs(last, b"\x5a"),
            lambda: io.write_output_bit(last, 0, True),
            lambda: io.write_outputs(last, before),
        ]
    if bus is not None and harness.can(Capability.STATISTICS):
        works.append(lambda: bus.reset_statistics(0))
    if bus is not None and harness.can(Capability.HOT_CONNECT):
        works.append(lambda: bus.start_hot_connect(0))
    if bus is not None and harness.can(Capability.OBJECTS):
        works += [partial(rewrite, bus, node, HARMLESS[0]) for node in bus.node_ids(0)]
    if not works:
        pytest.skip("the device has axes only")
    targets = harness.move_all()
    for work in works:
        with suppress(RobotdError):
            work()
        harness.periods(1)
    harness.rest()
    assert not harness.off_target(targets)
    assert harness.image.motion_complete.all()
    assert harness.image.servo_on.all()


def rewrite(bus: FieldbusDriver, node: int, index: int) -> None:
    """Write an object of a node as it is."""
    bus.write_object(0, node, index, 0, bus.read_object(0, node, index, 0))


@pytest.mark.clause("AxisDriver.cautions/dangers", "AxisDriver.cautions/known")
def test_each_caution_is_a_line_of_text(unopened: Harness) -> None:
    """Before the device is opened, and while it communicates."""
    driver = unopened.drivers.axes
    for opened in (False, True):
        if opened:
            unopened.start(enable=False)
        cautions = driver.cautions
        assert not isinstance(cautions, str), f"cautions are a list of texts, not {cautions!r}"
        wrong = [caution for caution in cautions if not caution.strip() or "\n" in caution]
        assert not wrong, f"{wrong[0]!r} is not a line of text"
