"""Ageing of values: stale values are never shown as fresh."""

from __future__ import annotations

import time
from contextlib import suppress

import numpy as np
import pytest

from robotd.api import ConnectionState, DeviceDriver, FaultInjector, ProcessImage, Unsupported
from robotd.api.robots import Outcome
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import judge, record_move

CALLS = 20
PAUSE_S = 0.4  # shorter than what makes values stale, so that their stamps are seen
SAMPLES = 60
SILENT_PERIODS = 3  # of the feedback, besides those in which what is on its way arrives


@pytest.mark.clause("AxisDriver.read/fresh")
def test_values_are_fresh(harness: Harness) -> None:
    ages_s = []

    def watch(image: object) -> None:
        ages_s.append((harness.clock.now_ns() - harness.image.fresh_ns) * 1e-9)

    with harness.each_period(watch):
        harness.pass_time(0.3)
    assert max(ages_s) <= harness.robot.connection.settings.stale_after_s
    assert min(ages_s) >= -harness.period_s, "values from the future: another clock was used"


@pytest.mark.clause("AxisDriver.read/fresh", "AxisDriver.feedback_period_s/held")
@pytest.mark.clause("AxisDriver.read/taken")
def test_a_time_stamp_is_that_of_the_arrival(harness: Harness) -> None:
    """The newest of all values of a feedback period have just arrived."""
    check_ages(harness)


@pytest.mark.clause("AxisDriver.read/fresh", "DeviceDriver.start_communication/starts")
@pytest.mark.parametrize("reopen", [False, True], ids=["stopped", "closed"])
def test_a_pause_of_communication_makes_no_value_older(fresh: Harness, reopen: bool) -> None:
    connection = fresh.robot.connection
    if reopen:
        connection.close()
    else:
        connection.stop_communication()
    fresh.pass_time(PAUSE_S)
    connection.start()
    fresh.until(lambda: connection.ready, "values arrive again")
    check_ages(fresh)


def check_ages(harness: Harness) -> None:
    """Fail unless some value is stamped when it arrives, while ``SAMPLES`` arrive."""
    ages_s = []

    def watch(image: ProcessImage) -> None:
        ages_s.append((harness.clock.now_ns() - image.fresh_ns) * 1e-9)

    with harness.each_period(watch):
        harness.periods(SAMPLES)
    assert min(ages_s) <= harness.feedback_s + 1.5 * harness.period_s, (
        f"values are stamped at least {1e3 * min(ages_s):.1f} ms before they are shown"
    )


@pytest.mark.clause("AxisDriver.read/fresh", "AxisDriver.read/measured")
@pytest.mark.clause("AxisDriver.read/taken")
def test_values_are_as_old_as_their_time_stamp(harness: Harness, injector: FaultInjector) -> None:
    injector.position(0)
    targets = harness.image.position_command + harness.travel()
    times_s, shaft, stamps_s, shown = list[float](), list[float](), list[float](), list[float]()

    def watch(image: ProcessImage) -> None:
        times_s.append(harness.clock.now_ns() * 1e-9)
        shaft.append(injector.position(0))
        stamps_s.append(image.fresh_ns * 1e-9)
        shown.append(float(image.position[0]))

    with harness.recording() as recording, harness.each_period(watch):
        harness.move(harness.all, targets)
        harness.rest()
    truly = np.interp(stamps_s, times_s, shaft)
    error = np.abs(np.array(shown) - truly)[5:].max()
    allowed = 2.0 * harness.feedback_s * harness.profile(0).velocity + SETTLED_RAD
    problems = [f"{error:.4f} rad from the shaft, allowed {allowed:.4f}"] if error > allowed else []
    judge(harness, recording, problems)


@pytest.mark.clause("AxisDriver.read/fresh")
def test_their_time_goes_on(harness: Harness) -> None:
    first = harness.image.fresh_ns
    harness.pass_time(0.2)
    assert abs((harness.image.fresh_ns - first) * 1e-9 - 0.2) <= 0.1


@pytest.mark.clause("AxisDriver.read/measured", "AxisDriver.read/commands")
@pytest.mark.short_period
def test_values_follow_the_motion(harness: Harness) -> None:
    stale_s = harness.robot.connection.settings.stale_after_s
    recording = record_move(harness)
    for axis in harness.all:
        fast = np.abs(recording.velocity_command[:, axis]) > 0.5 * harness.profile(axis).velocity
        assert fast.any(), "the commanded velocity does not show the motion"
        times_s, position = recording.time_s[fast], recording.position[fast, axis]
        changed = times_s[np.flatnonzero(np.diff(position, prepend=np.nan))]
        assert np.diff(changed).max(initial=0.0) <= stale_s
        assert len(changed) > 3, "the position stands still while the axis moves"


@pytest.mark.clause("FaultInjector.freeze/frozen")
@pytest.mark.clause("AxisDriver.read/fresh")
def test_a_dead_bus_does_not_look_alive(fresh: Harness) -> None:
    injector, connection = fresh.injector, fresh.robot.connection
    injector.freeze(True)
    stale_s = connection.settings.stale_after_s
    fresh.until(lambda: not connection.ready, "the engine is not ready", 3 * stale_s + 0.2)
    assert connection.state in (ConnectionState.UNKNOWN, ConnectionState.RUNNING)
    injector.freeze(False)
    if connection.state is ConnectionState.UNKNOWN:
        fresh.until(lambda: connection.ready, "the engine is ready again when values arrive")


@pytest.mark.clause("DeviceDriver.fault/reason")
@pytest.mark.clause("DeviceDriver.fault/blocks")
def test_the_device_says_at_once_why_it_is_silent(unopened: Harness) -> None:
    device: DeviceDriver = vars(unopened.drivers.device)["wrapped"]

    def said() -> str:
        began_s = time.perf_counter()
        text = min(device.fault() for _ in range(CALLS))
        assert (time.perf_counter() - began_s) / CALLS < unopened.period_s, "fault() blocks"
        assert "\n" not in text, "a fault is part of a line"
        return text

    said()
    unopened.start()
    assert said() == "", "a fault while fresh values arrive"
    if unopened.fault_injector is not None:
        with suppress(Unsupported):
            unopened.fault_injector.freeze(True)
            unopened.until(lambda: not unopened.robot.connection.ready, "the engine is not ready")
            said()
            unopened.fault_injector.freeze(False)
            if unopened.drivers.device.state() is ConnectionState.COMMUNICATING:
                unopened.until(lambda: unopened.robot.connection.ready, "values arrive again")
                assert said() == "", "a fault of the past is still reported"
    unopened.robot.connection.close()
    said()


@pytest.mark.clause("AxisDriver.read/fresh")
def test_a_dead_bus_ends_a_trajectory(
    harness: Harness, joints: list[int], injector: FaultInjector
) -> None:
    with harness.following([1.5], [harness.travel()[joints]]) as execution:
        harness.pass_time(0.4)
        injector.freeze(True)
        try:
            harness.until(lambda: execution.done, "the trajectory ends")
        finally:
            injector.freeze(False)
    assert execution.outcome is Outcome.FAULT
    harness.rest()


@pytest.mark.clause("AxisDriver.read/fresh", "DeviceDriver.stop_communication/ends")
def test_nothing_is_fresh_after_communication_stopped(fresh: Harness) -> None:
    fresh.robot.connection.stop_communication()
    fresh.pass_time(0.05)
    image = ProcessImage(fresh.count)
    fresh.drivers.axes.read(image)
    last = image.fresh_ns
    fresh.pass_time(0.2)
    fresh.drivers.axes.read(image)
    assert image.fresh_ns == last


@pytest.mark.clause("DeviceDriver.fault/reason")
def test_each_silence_has_its_reason(fresh: Harness) -> None:
    """A device that says why it is silent says so the second time, too."""
    device, said = fresh.drivers.device, list[str]()
    for _ in range(2):
        fresh.injector.freeze(True)
        fresh.until(lambda: not fresh.robot.connection.ready, "the engine is not ready")
        said.append(device.fault())
        thaw(fresh)
        fresh.periods(5)
        assert device.fault() == "", "a fault of the past is still reported"
    assert bool(said[0]) is bool(said[1]), f"the fault is {said[0]!r}, the second time {said[1]!r}"


@pytest.mark.clause("AxisDriver.read/fresh")
def test_a_short_silence_has_no_new_stamps(fresh: Harness) -> None:
    """Shorter than what ends the connection, three times."""
    image, settings = fresh.image, fresh.robot.connection.settings
    if (SILENT_PERIODS + 2) * fresh.feedback_s >= settings.stale_after_s:
        pytest.skip("values count as stale after fewer periods")
    for _ in range(3):
        fresh.injector.freeze(True)
        fresh.periods(2)
        last_ns = image.fresh_ns
        fresh.periods(SILENT_PERIODS)
        gained_ns = image.fresh_ns - last_ns
        thaw(fresh)
        assert gained_ns == 0, f"values are stamped {gained_ns * 1e-6:.1f} ms later, but none came"
        fresh.periods(2)


def thaw(harness: Harness) -> None:
    """Let values arrive again, from a device that may have given its link up meanwhile."""
    connection = harness.robot.connection
    harness.injector.freeze(False)
    if harness.drivers.device.state() is not ConnectionState.COMMUNICATING:
        connection.start()
    harness.until(lambda: connection.ready, "values arrive again")
