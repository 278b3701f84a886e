"""Nothing moves without a new command, whatever ran before and whatever has ended it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
import pytest

from robotd.api import (
    Capability,
    CommandMode,
    ConnectionState,
    FloatArray,
    Operation,
    ProcessImage,
    RobotdError,
)
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.mixed_motion import MOVES_S, MixedMotion, kinds_of, modes_of

ALARM = 0x32
LOOK_S, LOOK_STEPPED_S = 0.15, 0.6  # stepped time costs little
WAITS_S = 0.05  # for setpoints, less than the time-out of a device
TORQUE_SHARE, PUSHED_RAD_S = 0.3, 0.1  # of a joint's limit, until it moves so fast
TURNS = 2  # in real time; each axis executes two kinds of motion

End = Callable[[Harness, MixedMotion], None]


def finish(harness: Harness, motion: MixedMotion) -> None:
    motion.finish()


def stop(harness: Harness, motion: MixedMotion) -> None:
    harness.drivers.axes.stop(harness.all)


def quick_stop(harness: Harness, motion: MixedMotion) -> None:
    harness.drivers.axes.quick_stop(harness.all)


def servos_off(harness: Harness, motion: MixedMotion) -> None:
    for axis in harness.all:
        harness.drivers.axes.servo(axis, False, 5.0)


def stop_and_servos_off(harness: Harness, motion: MixedMotion) -> None:
    """Switched off while they stop."""
    stop(harness, motion)
    servos_off(harness, motion)


def servos_off_and_on(harness: Harness, motion: MixedMotion) -> None:
    """Switched on as soon as they are shown off, which a drive may reject while its axis moves."""
    servos_off(harness, motion)
    harness.periods(2)
    for axis in harness.all:
        with suppress(RobotdError):
            harness.drivers.axes.servo(axis, True, 5.0)


def change_modes_while_off(harness: Harness, motion: MixedMotion) -> None:
    servos_off(harness, motion)
    harness.rest()
    for mode in modes_of(harness):
        for axis in harness.all:
            harness.drivers.axes.set_command_mode(axis, mode)


def alarms(harness: Harness, motion: MixedMotion) -> None:
    for axis in harness.all:
        harness.injector.trip(axis, ALARM + axis)
    harness.until(lambda: bool(harness.image.amp_alarm.all()), "the alarms are shown", 1.0)


def restart(harness: Harness, motion: MixedMotion) -> None:
    harness.drivers.device.stop_communication(5.0)
    start_again(harness)


def reopen(harness: Harness, motion: MixedMotion) -> None:
    harness.drivers.device.close()
    start_again(harness)


def lose_link(harness: Harness, motion: MixedMotion) -> None:
    harness.injector.drop_communication()
    harness.until(lambda: not harness.robot.connection.ready, "the lost link is shown", 2.0)
    start_again(harness)


def die(harness: Harness, motion: MixedMotion) -> None:
    harness.injector.stop_engine()
    harness.until(lambda: not harness.robot.connection.ready, "the lost device is shown", 2.0)
    start_again(harness)


def lose_drive(harness: Harness, motion: MixedMotion) -> None:
    """Lose the last axis' drive; when it is back only the others are stopped."""
    if not harness.can(Capability.HOT_CONNECT):
        pytest.skip(f"the {harness.robot.backend.name} backend takes no drive in again")
    last, image = harness.count - 1, harness.image
    harness.injector.disconnect(last)
    harness.until(lambda: bool(image.offline[last]), "the lost drive is offline", 2.0)
    harness.injector.reconnect(last)
    harness.robot.fieldbus.start_hot_connect(0)
    harness.until(lambda: not image.offline[last], "the drive is back")
    harness.pass_time(WAITS_S)
    assert not image.servo_on[last], "the servo of a drive that was lost is on when it is back"
    harness.drivers.axes.stop(harness.all[:last])


def by_name(function: End) -> str:
    return function.__name__


ENDS = (
    finish,
    stop,
    quick_stop,
    servos_off,
    stop_and_servos_off,
    servos_off_and_on,
    change_modes_while_off,
    alarms,
)
NEW_CONNECTIONS = (restart, reopen, lose_link, die, lose_drive)


@pytest.mark.clause("AxisDriver/resumption", "AxisDriver.servo/no-jump")
@pytest.mark.clause("AxisDriver.set_command_mode/nothing-moves")
@pytest.mark.clause("AxisDriver.begin_stream/waits", "AxisDriver.end_stream/moves")
@pytest.mark.clause("AxisDriver.stream/others", "AxisDriver.begin_stream/operation")
@pytest.mark.parametrize("end", ENDS, ids=by_name)
def test_nothing_moves_after_the_end_of_a_motion(harness: Harness, end: End) -> None:
    for turn in turns(harness):
        look(harness, run_and_end(harness, turn, end).kinds)
    harness.enable()


@pytest.mark.clause("DeviceDriver.start_communication/nothing-moves")
@pytest.mark.clause("AxisDriver/resumption", "AxisDriver/servos", "AxisDriver.stream/others")
@pytest.mark.clause("AxisDriver.set_command_mode/nothing-moves")
@pytest.mark.clause("DeviceDriver.stop_communication/axes-stop", "DeviceDriver.close/disconnects")
@pytest.mark.parametrize("end", NEW_CONNECTIONS, ids=by_name)
@pytest.mark.short_period
def test_nothing_moves_after_a_new_connection(fresh: Harness, end: End) -> None:
    for turn in turns(fresh):
        look(fresh, run_and_end(fresh, turn, end).kinds)


@pytest.mark.clause("AxisDriver/resumption", "AxisDriver.servo/no-jump")
def test_a_command_that_was_rejected_is_forgotten(fresh: Harness) -> None:
    driver, targets = fresh.drivers.axes, fresh.image.position_command + fresh.travel(0.1)
    for mode in modes_of(fresh):
        fresh.disable()
        fresh.rest()
        for axis in fresh.all:
            driver.set_command_mode(axis, mode)
            profile = fresh.profile(axis, 0.2)
            with suppress(RobotdError):
                if mode is CommandMode.VELOCITY:
                    driver.jog(axis, profile)
                else:
                    driver.move(axis, float(targets[axis]), profile)
        enable(fresh)
        stays(fresh, ["command that was rejected"] * fresh.count, "the servos are switched on")


@pytest.mark.clause("AxisDriver.home/no-motion", "AxisDriver/resumption")
@pytest.mark.needs(Capability.HOMING)
@pytest.mark.short_period
def test_nothing_moves_after_homing(fresh: Harness) -> None:
    """Off zero; the command of the motion before counts from another place than the axis then."""
    fresh.require_rescaling()
    motion = run_and_end(fresh, 0, stop)
    enable(fresh)
    for axis in fresh.all:
        fresh.drivers.axes.home(axis, 10.0)
    fresh.pass_time(WAITS_S + fresh.feedback_s)  # the image has the new positions
    look(fresh, motion.kinds)


@pytest.mark.clause("AxisDriver/resumption", "AxisDriver.stream_torque/others")
@pytest.mark.clause("AxisDriver.stop/torque", "AxisDriver.set_command_mode/torque")
@pytest.mark.needs(Capability.TORQUE_MODE)
@pytest.mark.parametrize("end", [stop, quick_stop, servos_off, alarms], ids=by_name)
def test_no_torque_acts_after_the_end_of_its_stream(fresh: Harness, end: End) -> None:
    joints = zip(fresh.robot.descriptor.joints, fresh.joints, strict=True)
    torques = {axis: TORQUE_SHARE * (joint.effort_limit or 0.0) for joint, axis in joints}
    axes = [axis for axis, torque in torques.items() if torque]
    if not axes:
        pytest.skip("no joint has a torque limit (joints[].torque_limit_nm)")
    driver, image, sends = fresh.drivers.axes, fresh.image, fresh.can(Capability.SIMULATED)
    forces: FloatArray = np.full(fresh.count, np.nan)
    forces[axes] = np.sign(fresh.travel()[axes]) * [torques[axis] for axis in axes]
    kinds = ["stream of torques"] * fresh.count
    ended = False

    def send(image: ProcessImage) -> None:
        """Push each axis until it moves."""
        if sends or not ended:
            slow = np.abs(image.velocity) < PUSHED_RAD_S
            driver.stream_torque(np.where(slow | ended, forces, 0.0 * forces), fresh.due_ns)

    for axis in axes:
        driver.set_command_mode(axis, CommandMode.TORQUE)
    stays(fresh, kinds, "the mode is changed to torque")
    start = image.position.copy()
    driver.begin_stream(axes)
    with fresh.each_period(send):
        fresh.until(
            lambda: bool((np.abs(image.position - start)[axes] > 2 * SETTLED_RAD).all()),
            "torques move the axes",
        )
        ended = True
        end(fresh, MixedMotion(fresh))
        fresh.rest()
        enable(fresh)
        stays(fresh, kinds, "servos are on, while torques of an ended stream arrive")
    for axis in fresh.all:
        driver.set_command_mode(axis, CommandMode.POSITION)
    stays(fresh, kinds, "the mode is changed to position")


def turns(harness: Harness) -> range:
    count = len(kinds_of(harness))
    return range(count if harness.stepped else min(TURNS, count))


def run_and_end(harness: Harness, turn: int, end: End) -> MixedMotion:
    """Leave the axes at rest; to a simulation setpoints are still sent then."""
    motion = MixedMotion(harness, turn)
    kinds = motion.kinds
    motion.prepare()
    with motion.running():
        harness.pass_time(MOVES_S)
        motion.require_motion()
        end(harness, motion)
        motion.sends = harness.can(Capability.SIMULATED)
        harness.rest()
        if motion.sends:
            stays(harness, kinds, "it is over, while setpoints still arrive")
            enable(harness)
            stays(harness, kinds, "servos are on, while setpoints of an ended stream arrive")
    return motion


def look(harness: Harness, kinds: Sequence[str]) -> None:
    """Switch servos and modes: each leaves the axes where they are."""
    enable(harness)
    stays(harness, kinds, "alarms are cleared and servos switched on")
    driver = harness.drivers.axes
    for mode in reversed(modes_of(harness)):
        for axis in harness.all:
            driver.set_command_mode(axis, mode)
        stays(harness, kinds, f"the mode is changed to {mode.name.lower()}")
    if not harness.robot.axes.trajectories_on_device:
        driver.begin_stream(harness.all)
        stays(harness, kinds, "a stream has begun without setpoints", Operation.STREAM)
        driver.end_stream(harness.all)
        stays(harness, kinds, "a stream without setpoints has ended")


def enable(harness: Harness) -> None:
    """Clear alarms and switch the servos on, in the modes that they are in."""
    for axis in harness.all:
        harness.drivers.axes.clear_alarm(axis, 5.0)
        harness.drivers.axes.servo(axis, True, 5.0)


def stays(
    harness: Harness, kinds: Sequence[str], what: str, shown: Operation = Operation.IDLE
) -> None:
    """Raise AssertionError naming an axis that moves when ``what``, or is not in ``shown``."""
    looks_s = LOOK_STEPPED_S if harness.stepped else LOOK_S
    start = harness.image.position.copy()
    with harness.recording() as recording:
        harness.pass_time(looks_s if shown is Operation.IDLE else WAITS_S)
    moved = np.abs(recording.position - start).max(0)
    for axis, kind in enumerate(kinds):
        operation = Operation(int(harness.image.operation[axis]))
        assert moved[axis] <= SETTLED_RAD, (
            f"axis {axis} moves by {moved[axis]:.3g} rad without a command after a {kind},"
            f" when {what}"
        )
        assert operation is shown, f"axis {axis} is in {operation.name} after a {kind}, when {what}"


def start_again(harness: Harness) -> None:
    """Communicate again; servos are as they are then, and none goes on by itself."""
    connection = harness.robot.connection
    harness.pass_time(0.3)
    if harness.drivers.device.state() is ConnectionState.RUNNING:
        connection.start_communication()
    else:
        connection.start()
    harness.until(lambda: connection.ready, "the engine is ready")
    harness.until(lambda: bool(np.isfinite(harness.image.position).all()), "positions are known")
    at_first = harness.image.servo_on.copy()  # a controller may keep them on without its link
    harness.pass_time(WAITS_S)
    on = np.flatnonzero(harness.image.servo_on & ~at_first).tolist()
    assert not on, f"the servos of axes {on} go on when communication has begun again"
