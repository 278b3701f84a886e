"""State and effect of events during motion: on one axis, repeated, and far from zero."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

import numpy as np
import pytest

from robotd.api import Capability, FloatArray, Operation, ProcessImage
from robotd_conformance.checks.harness import SETTLED_RAD, STANDSTILL_RAD_S, Harness
from robotd_conformance.checks.recorded_motion import (
    jog,
    judge,
    ramped,
    record_stream,
    there_and_back,
)

JOG_SHARES = (1.0, 0.35, -1.0)  # of the speed of a profile
EXACT = 0.02  # share by which a velocity may differ from the commanded one
STREAM_SHARE, RAMP_S = 0.6, 0.15  # of a profile's speed; of a stream
STOPPED_S = 0.3  # after the start of a stream
INTERMEDIATE = (0.08, 0.92)  # shares of the speed: neither the one before the stop nor rest
STEPS_PERIOD_S = 0.01  # longest period in which a ramp shows intermediate velocities
WAVE_HZ, WAVES, WAVE_SHARE = 2.0, 2, 0.05  # of a stream that curves; of the travel
MOST_LAG = 8  # periods
OUTLIER, BENT = 4.0, 0.5  # times the usual error; share of what a missing setpoint bends
FAR_SHARE = 0.9  # of the distance to a limit
LOST_S = 3.0
STALE_S = 0.5  # of watching the other axes
CODES = (0x07, 0x2310)


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.jog/starts", "AxisDriver.read/commands", "AxisDriver.read/measured")
@pytest.mark.short_period
def test_a_velocity_command_is_met_and_shown_exactly(fresh: Harness) -> None:
    """Once the ramps have ended: commanded, measured, and by the distance."""
    fresh.set_velocity_mode()
    for share in JOG_SHARES:
        speeds = share * fresh.speeds(0.4)
        jog(fresh, speeds)
        fresh.pass_time(0.3)
        with fresh.recording() as recording:
            fresh.pass_time(0.3)
        span_s = recording.time_s[-1] - recording.time_s[0]
        shown = {
            "velocity command": recording.velocity_command.mean(0),
            "measured velocity": recording.velocity.mean(0),
            "change of the position": (recording.position[-1] - recording.position[0]) / span_s,
        }
        judge(fresh, recording, [
            f"axis {axis}: {what} {value[axis]:.4g} rad/s, commanded {speeds[axis]:.4g} ±"
            f" {EXACT:.0%}"
            for what, value in shown.items()
            for axis in fresh.all
            if abs(value[axis] - speeds[axis]) > EXACT * abs(speeds[axis])
        ])  # fmt: skip
    jog(fresh, np.zeros(fresh.count))
    fresh.rest()


@pytest.mark.clause("AxisDriver.read/mode", "AxisDriver.stop/starts")
@pytest.mark.parametrize("kind", ["jog", "stream"])
def test_what_is_stopped_is_not_shown_as_a_move(fresh: Harness, kind: str) -> None:
    """A move is a command of its own, and none was given."""
    ends = begin_motion(fresh, kind)
    shown: list[np.ndarray] = []
    with fresh.each_period(lambda image: shown.append(image.operation.copy())):
        fresh.drivers.axes.stop(fresh.all)
        fresh.rest()
    ends()
    for axis, row in enumerate(np.array(shown).T):
        wrong = np.flatnonzero(row == Operation.POSITION)
        assert not wrong.size, (
            f"axis {axis} shows a move {1e3 * wrong[0] * fresh.period_s:.0f} ms after the stop of"
            f" a {kind}"
        )


def begin_motion(harness: Harness, kind: str) -> Callable[[], None]:
    """Let all axes jog or stream at constant speed; return what ends it after the stop."""
    driver, speeds = harness.drivers.axes, harness.speeds(0.4)
    if kind == "jog":
        if not harness.can(Capability.VELOCITY_MODE):
            pytest.skip(f"the {harness.robot.backend.name} backend has no velocity mode")
        harness.set_velocity_mode()
        jog(harness, speeds)
        harness.pass_time(0.25)
        return lambda: None
    if harness.robot.axes.trajectories_on_device:
        pytest.skip("positions are not streamed: trajectories run on the device")
    send = Stream(harness, speeds)
    driver.begin_stream(harness.all)
    with harness.each_period(send):
        harness.pass_time(STOPPED_S)
    return lambda: driver.end_stream(harness.all)


class Stream:
    """Setpoints of a path that slows down soon after it should have been stopped. Control loop."""

    def __init__(self, harness: Harness, speeds: FloatArray) -> None:
        self._harness, self._speeds = harness, speeds
        self._start = harness.image.position_command.copy()
        self._began_ns = harness.clock.now_ns()

    def __call__(self, image: ProcessImage) -> None:
        time_s = (self._harness.due_ns - self._began_ns) * 1e-9
        distance_s, share = ramped(max(0.0, time_s), RAMP_S, STOPPED_S + 0.02)
        self._harness.stream(self._start + distance_s * self._speeds, share * self._speeds)


@pytest.mark.clause("AxisDriver.stop/stream", "AxisDriver.stop/ramp")
def test_a_stop_in_a_stream_has_a_ramp(streamed: Harness) -> None:
    """The ramp has any steepness, but the velocity never jumps to rest; there and back."""
    if not streamed.stepped or streamed.feedback_s > STEPS_PERIOD_S:
        pytest.skip("single periods are judged in simulated time, at 100 Hz and more")
    driver = streamed.drivers.axes
    for number, begin, end in there_and_back(streamed):
        speeds = np.sign(end - begin) * np.abs(streamed.speeds(STREAM_SHARE))
        send = Stream(streamed, speeds)
        driver.begin_stream(streamed.all)
        with streamed.recording() as recording, streamed.each_period(send):
            streamed.pass_time(STOPPED_S)
            before = len(recording)
            driver.stop(streamed.all)
            streamed.pass_time(0.2)
        driver.end_stream(streamed.all)
        streamed.rest()
        shares = np.abs(recording.velocity_command[before - 1 :] / speeds)
        between = ((shares > INTERMEDIATE[0]) & (shares < INTERMEDIATE[1])).sum(0)
        judge(streamed, recording, [
            f"axis {axis}: stop {number + 1} takes the velocity from {speeds[axis]:.3g} rad/s to"
            f" rest within a period of {1e3 * streamed.period_s:g} ms"
            for axis in np.flatnonzero(between == 0).tolist()
            if isfinite(streamed.robot.axes.limits[axis].acceleration)
        ])  # fmt: skip


@pytest.mark.clause("AxisDriver.stream/position", "AxisDriver.stream/setpoint")
def test_no_setpoint_of_a_curved_stream_is_left_out(streamed: Harness) -> None:
    """A setpoint that is missing bends the path by half its acceleration times period²."""
    if not streamed.stepped:
        pytest.skip("single setpoints are judged in simulated time")
    start, began_ns = streamed.image.position_command.copy(), streamed.clock.now_ns()
    size, rate = WAVE_SHARE * streamed.travel(), 2.0 * np.pi * WAVE_HZ
    sent, shown = list[FloatArray](), list[FloatArray]()

    def send(image: ProcessImage) -> None:
        phase = rate * (streamed.due_ns - began_ns) * 1e-9
        sent.append(start + size * (1.0 - np.cos(phase)))
        shown.append(image.position_command.copy())
        streamed.stream(sent[-1], size * rate * np.sin(phase))

    record_stream(streamed, send, WAVES / WAVE_HZ)
    bend = 0.5 * np.abs(size) * rate**2 * streamed.period_s**2
    for axis in streamed.all:
        wanted, found = np.array(sent)[:, axis], np.array(shown)[:, axis]
        errors = [
            np.abs(found[lag + 2 :] - wanted[2 : len(wanted) - lag]) for lag in range(MOST_LAG)
        ]
        error = min(errors, key=lambda of_lag: float(np.median(of_lag)))
        usual = float(np.median(error))
        wrong = np.flatnonzero(error > np.maximum(OUTLIER * usual, BENT * bend[axis]))
        assert usual > BENT * bend[axis] or not wrong.size, (
            f"axis {axis} is {error[wrong[0]]:.2g} rad off setpoint {wrong[0] + 2}, usually"
            f" {usual:.2g} rad; {len(wrong)} of {len(error)} setpoints are left out"
        )


@pytest.mark.needs(Capability.SIMULATED)
@pytest.mark.free_space
@pytest.mark.clause("AxisDriver.stream/position", "AxisDriver.jog/starts", "AxisDriver.stop/rests")
def test_every_kind_of_motion_is_right_far_from_zero(fresh: Harness) -> None:
    """Streams, jogs and stops near a limit (nine tenths), or 20 rad away."""
    room, here = fresh.pose.room, fresh.image.position_command
    ends = room[0] if abs(room[0]).sum() > abs(room[1]).sum() else room[1]
    far = np.array([
        here[axis] + FAR_SHARE * (end - here[axis]) if isfinite(end) else 20.0
        for axis, end in enumerate(ends)
    ])  # fmt: skip
    fresh.move(fresh.all, far, [fresh.profile(axis) for axis in fresh.all])
    fresh.until(lambda: bool(fresh.image.motion_complete.all()), "the far positions", 60.0)
    fresh.rest()
    assert not fresh.off_target(far)
    distance = -0.05 * np.sign(
        far - (fresh.pose.position if fresh.pose.position is not None else 0.0)
    )
    if not fresh.robot.axes.trajectories_on_device:
        began_ns = fresh.clock.now_ns()

        def send(image: ProcessImage) -> None:
            share = min((fresh.due_ns - began_ns) * 2e-9, 1.0)
            fresh.stream(
                far + distance * (3 * share**2 - 2 * share**3), 12.0 * distance * (share - share**2)
            )

        record_stream(fresh, send, 0.6)
        assert not fresh.off_target(far + distance)
    if fresh.can(Capability.VELOCITY_MODE):
        fresh.set_velocity_mode()
        begin = fresh.image.position.copy()
        jog(fresh, np.sign(distance) * 0.1)
        fresh.pass_time(0.5)
        fresh.drivers.axes.stop(fresh.all)
        fresh.rest()
        gone = (fresh.image.position - begin) * np.sign(distance)
        wrong = np.flatnonzero(abs(gone - 0.05) > 0.015)
        assert not wrong.size, (
            f"axis {wrong[0]}: a jog of 0.1 rad/s for 0.5 s at {begin[wrong[0]]:.3g} rad has gone"
            f" {gone[wrong[0]]:.3g} rad"
        )
        assert np.abs(fresh.image.velocity).max() < STANDSTILL_RAD_S


@pytest.mark.needs(Capability.HOT_CONNECT)
@pytest.mark.clause("FieldbusDriver.start_hot_connect/joins", "AxisDriver.read/measured")
@pytest.mark.clause("AxisDriver.read/states", "AxisDriver.read/fresh", "drivers/loop")
def test_one_lost_axis_leaves_the_values_of_the_others(fresh: Harness) -> None:
    """They stay fresh and move; the lost one is where its shaft is when it is back."""
    bus, injector, last = fresh.drivers.fieldbus, fresh.injector, fresh.count - 1
    if bus is None or last == 0:
        pytest.skip("there is no other axis, or no fieldbus")
    fresh.move_all(0.5)
    fresh.rest()
    injector.disconnect(last)
    fresh.until(lambda: bool(fresh.image.offline[last]), "the drive is offline", LOST_S)
    calls, others = len(fresh.wrong_calls), fresh.all[:last]
    assert not fresh.image.offline[others].any(), "more axes than the lost one are offline"
    stamps: list[int] = []
    with fresh.each_period(lambda image: stamps.append(image.fresh_ns)):
        fresh.pass_time(STALE_S)
    gained_s = (stamps[-1] - stamps[0]) * 1e-9
    assert gained_s > 0.5 * STALE_S, (
        f"values got {gained_s:.3f} s newer in {STALE_S:g} s while one axis is lost"
    )
    targets = fresh.image.position_command + fresh.travel(0.2)
    fresh.move([axis for axis in others if fresh.image.servo_on[axis]], targets)
    fresh.rest(others)
    assert len(fresh.wrong_calls) == calls, fresh.wrong_calls[-1]
    injector.reconnect(last)
    bus.start_hot_connect(0)
    fresh.until(lambda: not fresh.image.offline.any(), "the drive is back")
    fresh.periods(5)
    shafts = np.array([injector.position(axis) for axis in fresh.all])
    assert fresh.image.position == pytest.approx(shafts, abs=SETTLED_RAD)
    fresh.enable()
    targets[last] = fresh.image.position_command[last] - fresh.travel(0.2)[last]
    fresh.move(fresh.all, targets)
    fresh.rest()
    shafts = np.array([injector.position(axis) for axis in fresh.all])
    assert fresh.image.position == pytest.approx(shafts, abs=SETTLED_RAD)
    assert not fresh.off_target(targets)


@pytest.mark.clause("AxisDriver.read/alarms", "DeviceDriver.open/connects")
@pytest.mark.clause("FaultInjector.trip/until")
def test_an_alarm_of_the_next_connection_has_its_own_code(fresh: Harness) -> None:
    """Fails the first and the last axis, then with the codes in the other order."""
    connection, last = fresh.robot.connection, fresh.count - 1
    for codes in (CODES, CODES[::-1]):
        for axis, code in zip((0, last), codes, strict=True):
            fresh.injector.trip(axis, code)
            fresh.until(lambda axis=axis: bool(fresh.image.amp_alarm[axis]), "the alarm", 1.0)  # type: ignore[misc]
            fresh.periods(5)
            shown = int(fresh.image.alarm_code[axis])
            assert shown == code, f"axis {axis} shows {shown:#x}, its alarm is {code:#x}"
            fresh.robot.axes.clear_alarm(axis)
        connection.close()
        fresh.start()


@pytest.mark.clause("DeviceDriver.open/connects", "DeviceDriver.state/lost-link")
@pytest.mark.clause("FaultInjector.stop_engine/dies")
def test_the_first_attempt_after_the_end_of_the_engine_connects(fresh: Harness) -> None:
    connection = fresh.robot.connection
    for _ in range(2):
        fresh.injector.stop_engine()
        fresh.until(lambda: not connection.ready, "the engine is lost", LOST_S)
        fresh.drivers.device.close()
        fresh.drivers.device.open()
        fresh.drivers.device.start_communication(10.0)
        fresh.start()


@pytest.mark.clause("AxisDriver.stop/starts", "AxisDriver.quick_stop/starts")
@pytest.mark.clause("FaultInjector.freeze/frozen")
@pytest.mark.parametrize("quick", [False, True], ids=["stop", "quick_stop"])
def test_a_stop_needs_no_fresh_values(fresh: Harness, quick: bool) -> None:
    """The device says nothing any more, and the shafts come to rest nevertheless."""
    injector, driver = fresh.injector, fresh.drivers.axes
    start = np.array([injector.position(axis) for axis in fresh.all])
    fresh.move_all()
    fresh.pass_time(0.15)
    injector.freeze(True)
    fresh.periods(2)
    (driver.quick_stop if quick else driver.stop)(fresh.all)
    fresh.pass_time(0.4)
    shafts = np.array([injector.position(axis) for axis in fresh.all])
    fresh.pass_time(0.1)
    later = np.array([injector.position(axis) for axis in fresh.all])
    injector.freeze(False)
    gone = np.abs(shafts - start) / np.abs(fresh.travel())
    wrong = [
        f"axis {axis} has gone {gone[axis]:.0%} of its travel, and {abs(later - shafts)[axis]:.3g}"
        " rad more within 0.1 s, after a stop without fresh values"
        for axis in fresh.all
        if gone[axis] > 0.9 or abs(later - shafts)[axis] > SETTLED_RAD
    ]
    assert not wrong, "; ".join(wrong)


@pytest.mark.clause("AxisDriver.servo/disables", "FaultInjector.disconnect/silent")
def test_a_servo_goes_off_while_another_drive_is_lost_or_in_alarm(fresh: Harness) -> None:
    """Taking away energy does not need the other axes to be well."""
    last = fresh.count - 1
    if last == 0 or len(fresh.servo_group(last)) > 1 or len(fresh.alarm_group(last)) > 1:
        pytest.skip("no other axis with a servo and an alarm of its own")
    driver, image = fresh.drivers.axes, fresh.image
    fresh.injector.trip(last, CODES[1])
    fresh.until(lambda: bool(image.amp_alarm[last]), "the alarm is shown", 1.0)
    switch_first(fresh)
    driver.clear_alarm(last, 5.0)
    fresh.injector.disconnect(last)
    fresh.until(lambda: bool(image.offline[last]), "the drive is offline", LOST_S)
    switch_first(fresh)


def switch_first(harness: Harness) -> None:
    """Switch the servo of axis 0 off and on."""
    driver, image = harness.drivers.axes, harness.image
    driver.servo(0, False, 5.0)
    harness.periods(3)
    assert not image.servo_on[0], "axis 0 is on, and was switched off"
    driver.servo(0, True, 5.0)
    harness.periods(3)
