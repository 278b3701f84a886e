"""Open, stop and close: in motion, repeatedly, and without leftovers of the connection before."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robotd.api import (
    Capability,
    CommandMode,
    ConnectionState,
    DeviceDriver,
    FaultInjector,
    FloatArray,
    Operation,
    Profile,
    RobotdError,
)
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import jog, mean_velocity
from robotd_conformance.checks.test_units import stream_ramp

COASTS_S = 1.0  # longest time to come to rest once the device is closed
LOOK_S = 0.3
SHARE = 0.3
ALARM = 0x32

End = Callable[[Harness], None]
ENDS = [
    pytest.param(lambda harness: harness.drivers.device.close(), id="close"),
    pytest.param(lambda harness: harness.drivers.device.stop_communication(5.0), id="stop"),
]


@pytest.mark.clause("DeviceDriver.open/again")
def test_opening_an_open_device_has_no_effect(fresh: Harness) -> None:
    device, targets = fresh.drivers.device, fresh.move_all()
    fresh.pass_time(0.1)
    device.open()
    assert device.state() is ConnectionState.COMMUNICATING, "open() of an open device resets it"
    fresh.rest()
    assert not fresh.off_target(targets)
    assert fresh.image.servo_on.all()
    assert fresh.image.motion_complete.all()


@pytest.mark.clause("DeviceDriver.open/again", "DeviceDriver.open/connects")
def test_opening_twice_before_communication_has_no_effect(unopened: Harness) -> None:
    device = unopened.drivers.device
    unopened.begin()
    unopened.open()
    device.open()
    assert device.state() is ConnectionState.RUNNING
    device.start_communication(10.0)
    assert device.state() is ConnectionState.COMMUNICATING


@pytest.mark.clause("DeviceDriver.close/axes-stop", "DeviceDriver.stop_communication/axes-stop")
@pytest.mark.parametrize("velocity", [False, True], ids=["move", "velocity_command"])
@pytest.mark.parametrize("end", ENDS)
def test_axes_in_motion_stop_when_the_device_ends(fresh: Harness, end: End, velocity: bool) -> None:
    injector = fresh.injector
    read_shafts(fresh, injector)
    if velocity:
        if not fresh.can(Capability.VELOCITY_MODE):
            pytest.skip("there are no velocity commands")
        fresh.set_velocity_mode()
        jog(fresh, fresh.speeds(SHARE))
    else:
        fresh.move(fresh.all, fresh.image.position_command + fresh.travel(), slow(fresh))
    fresh.pass_time(0.3)
    before = read_shafts(fresh, injector)
    end(fresh)
    fresh.pass_time(COASTS_S)
    try:
        first = read_shafts(fresh, injector)
    except (RobotdError, OSError):
        pytest.skip("the axes are simulated and end with the device")
    fresh.pass_time(LOOK_S)
    went = np.abs(read_shafts(fresh, injector) - first)
    assert went.max() <= SETTLED_RAD, "an axis goes on without its device"
    if fresh.robot.descriptor.parameters_file is not None:
        return  # what a position means may have ended with the device
    limit = np.abs(fresh.speeds(SHARE)) * COASTS_S / 2 + SETTLED_RAD
    assert (np.abs(first - before) <= limit).all(), "an axis went on without its device"


@pytest.mark.clause("DeviceDriver.close/disconnects", "DeviceDriver.close/twice")
def test_close_leads_to_idle_from_every_state(unopened: Harness) -> None:
    device = unopened.drivers.device
    unopened.begin()
    for steps in (0, 1, 2, 3):
        if steps > 0:
            unopened.open()
        if steps > 1:
            device.start_communication(10.0)
        if steps > 2:
            device.stop_communication(10.0)
        device.close()
        assert device.state() is ConnectionState.IDLE, f"after {steps} steps"
        device.close()
        assert device.state() is ConnectionState.IDLE
        with pytest.raises(RobotdError):
            device.start_communication(1.0)


@pytest.mark.clause("DeviceDriver.start_communication/nothing-moves")
@pytest.mark.clause("DeviceDriver.close/disconnects", "DeviceDriver.stop_communication/axes-stop")
@pytest.mark.parametrize("close", [True, False], ids=["closed", "stopped"])
def test_a_command_does_not_outlive_its_connection(fresh: Harness, close: bool) -> None:
    connection, modes = fresh.robot.connection, [CommandMode.POSITION]
    if fresh.can(Capability.VELOCITY_MODE):
        fresh.set_velocity_mode()
        jog(fresh, fresh.speeds(SHARE))
        modes.append(CommandMode.VELOCITY)
    else:
        fresh.move(fresh.all, fresh.image.position_command + fresh.travel(), slow(fresh))
    fresh.pass_time(0.2)
    if close:
        fresh.drivers.device.close()  # with servos on; the core switches them off before
    connection.stop_communication()
    fresh.pass_time(COASTS_S)
    fresh.start(enable=False)
    fresh.pass_time(LOOK_S)
    assert not fresh.image.servo_on.any(), "a servo is on without a command"
    assert (fresh.image.operation == Operation.IDLE).all()
    start = fresh.image.position.copy()
    fresh.enable()
    fresh.pass_time(LOOK_S)
    assert fresh.image.position == pytest.approx(start, abs=SETTLED_RAD)
    assert (fresh.image.operation == Operation.IDLE).all()


@pytest.mark.clause("AxisDriver.set_command_mode/changes")
@pytest.mark.clause("DeviceDriver.open/connects", "DeviceDriver.start_communication/starts")
@pytest.mark.clause("AxisDriver.move/starts", "AxisDriver.stop/starts", "AxisDriver.servo/switches")
@pytest.mark.clause("AxisDriver.clear_alarm/clears", "AxisDriver.begin_stream/follows")
@pytest.mark.clause("AxisDriver.jog/starts", "IoDriver.write_outputs/bytes")
@pytest.mark.parametrize("close", [True, False], ids=["closed", "stopped"])
def test_everything_works_again(fresh: Harness, close: bool) -> None:
    connection = fresh.robot.connection
    for _ in range(2):
        work(fresh)
        fresh.disable()
        if close:
            connection.close()
        else:
            connection.stop_communication()
        fresh.start()
    work(fresh)


def work(harness: Harness) -> None:
    """Use each kind of command once; every one must have its effect."""
    start = harness.image.position_command.copy()
    targets = harness.move_all(0.5)
    harness.rest()
    assert not harness.off_target(targets)
    harness.move(harness.all, start)
    harness.pass_time(0.1)
    harness.drivers.axes.stop(harness.all)
    harness.rest()
    away = np.abs(harness.image.position - start)
    assert (away > 2 * SETTLED_RAD).all(), "a stop has no effect"
    if not harness.robot.axes.trajectories_on_device:
        begin = harness.image.position_command.copy()
        stream_ramp(harness, begin, start, seconds=0.5)
        assert not harness.off_target(start)
    if harness.can(Capability.VELOCITY_MODE):
        jog_once(harness)
    if harness.fault_injector is not None:
        harness.trip(ALARM)
        assert harness.image.alarm_code[0] == ALARM
        harness.enable()
        harness.periods(3)
        assert not harness.image.amp_alarm.any()
    io = harness.drivers.io
    if io is not None and io.output_bytes:
        last = io.output_bytes - 1
        before = io.read_outputs(last, 1)
        for value in (b"\xa6", before):
            io.write_outputs(last, value)
            harness.until(lambda value=value: io.read_outputs(last, 1) == value, "written")  # type: ignore[misc]
    harness.move(harness.all, start)
    harness.rest()


def jog_once(harness: Harness) -> None:
    speeds = harness.speeds(SHARE)
    harness.set_velocity_mode()
    jog(harness, speeds)
    harness.pass_time(0.25)
    assert mean_velocity(harness) == pytest.approx(speeds, rel=0.1, abs=0.01)
    jog(harness, 0.0 * speeds)
    harness.rest()
    for axis in harness.all:
        harness.robot.axes.set_command_mode(axis, CommandMode.POSITION)


def slow(harness: Harness) -> list[Profile]:
    return [harness.profile(axis, SHARE) for axis in harness.all]


def read_shafts(harness: Harness, injector: FaultInjector) -> FloatArray:
    return np.array([injector.position(axis) for axis in harness.all])


def assert_fault_named(harness: Harness) -> None:
    """A lost device has a reason, unless its driver knows none and has no ``fault`` of its own."""
    device: DeviceDriver = vars(harness.drivers.device)["wrapped"]
    if type(device).fault is not DeviceDriver.fault:
        harness.until(lambda: bool(device.fault()), "fault() says why the device is lost", 1.0)


@pytest.mark.clause("DeviceDriver.fault/reason")
@pytest.mark.clause("FaultInjector.drop_communication/broken")
@pytest.mark.clause("AxisDriver.read/states")
@pytest.mark.clause("DeviceDriver.state/lost-link", "DeviceDriver.start_communication/resumes")
@pytest.mark.clause("DeviceDriver.start_communication/nothing-moves", "DeviceDriver.state/blocks")
def test_a_lost_link_is_shown_and_resumed(fresh: Harness) -> None:
    connection, device = fresh.robot.connection, fresh.drivers.device
    fresh.move_all()
    fresh.pass_time(0.1)
    fresh.injector.drop_communication()
    lost = (ConnectionState.UNKNOWN, ConnectionState.RUNNING, ConnectionState.IDLE)
    limit_s = connection.settings.stale_after_s + 2 * fresh.feedback_s
    fresh.until(lambda: device.state() in lost, "the lost link is shown", limit_s)
    fresh.until(lambda: not connection.ready, "the engine is not ready", limit_s)
    assert_fault_named(fresh)
    fresh.pass_time(COASTS_S)
    stood = read_shafts(fresh, fresh.injector)
    fresh.until(
        lambda: device.state() is not ConnectionState.UNKNOWN or connection.ready,
        "the device says whether communication can be resumed",
    )
    if device.state() is ConnectionState.RUNNING:
        connection.start_communication()
    else:
        connection.start()
    begun = read_shafts(fresh, fresh.injector)
    fresh.until(lambda: connection.ready, "the engine is ready again")
    fresh.rest()
    # Without its home an axis may count from another place since communication began.
    stood = np.where(fresh.image.home_done, stood, begun)
    fresh.enable()
    fresh.pass_time(LOOK_S)
    went = np.abs(read_shafts(fresh, fresh.injector) - stood)
    assert went.max() <= SETTLED_RAD, "an axis moves without a command when the link returns"
    fresh.return_to_start()


@pytest.mark.clause("FaultInjector.stop_engine/dies", "DeviceDriver.fault/reason")
@pytest.mark.clause("DeviceDriver.state/lost-link", "DeviceDriver.open/connects")
def test_a_device_that_died_can_be_opened_again(fresh: Harness) -> None:
    connection, device = fresh.robot.connection, fresh.drivers.device
    fresh.injector.stop_engine()
    lost = (ConnectionState.UNKNOWN, ConnectionState.RUNNING, ConnectionState.IDLE)
    fresh.until(lambda: device.state() in lost, "the end of the device is shown", 1.0)
    fresh.until(lambda: not connection.ready, "the engine is not ready", 2.0)
    assert_fault_named(fresh)
    connection.close()
    fresh.start()
    targets = fresh.move_all(0.2)
    fresh.rest()
    assert not fresh.off_target(targets)
