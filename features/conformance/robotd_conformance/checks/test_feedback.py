"""Measured values: measured, stamped on arrival, and distinct from commands."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from robotd.api import Capability, FaultInjector, ProcessImage
from robotd_conformance.checks.harness import SETTLED_RAD, STANDSTILL_RAD_S, Harness
from robotd_conformance.checks.test_small_and_large import steep

LONG_S, LONG_STEPPED_S = 5.0, 20.0  # stepped time costs little
ACCELERATING_SHARE = 5e-5  # of the torque's range, that its acceleration accounts for
HELD = 0.2  # share of the samples that may repeat a value, of a computer that stalls
DECLARED, OFTEN = 100, 0.7  # periods of the feedback, and share of them with new values
UNDATED = 0.5  # share of the values whose time may wait for a slower drive of the same bus
STEEP, STRONG = 0.9, 0.7  # shares of an axis' limits, and of its largest torque
CODES = (0x07, 0x2310, 0x8611)
A_WORD = re.compile(r"[^\W\d_]{3}")
EMPTY_WORDS = {"alarm", "error", "fault", "failed", "unknown", "none", "n/a"}


@pytest.mark.clause("AxisDriver.read/fresh")
def test_time_stamps_never_go_back(harness: Harness) -> None:
    stamps: list[int] = []
    harness.move_all()
    with harness.each_period(lambda image: stamps.append(image.fresh_ns)):
        harness.pass_time(0.5)
    steps = np.diff(stamps)
    assert (steps >= 0).all(), "a value is older than the one before"
    assert steps.max() <= 1e9 * (5 * harness.feedback_s + 0.05)
    harness.rest()


@pytest.mark.clause("AxisDriver.feedback_period_s/period")
def test_values_arrive_as_often_as_declared(harness: Harness) -> None:
    """While the axes move: at rest a position is the one before."""
    seen: list[tuple[int, int, bytes]] = []

    def look(image: ProcessImage) -> None:
        if np.abs(image.velocity_command).max() > STANDSTILL_RAD_S and len(seen) < most:
            seen.append((image.stamp_ns, image.fresh_ns, image.position.tobytes()))

    most = round(DECLARED * harness.feedback_s / harness.period_s)
    with harness.each_period(look):
        harness.move_all(speed=0.3)
        harness.rest()
    read_ns, fresh_ns, positions = zip(*seen, strict=True)
    wanted = min(len(seen) - 1, (read_ns[-1] - read_ns[0]) * 1e-9 / harness.feedback_s)
    for what, values in (("time stamps", fresh_ns), ("positions", positions)):
        new = sum(value != before for value, before in pairwise(values))
        assert new >= OFTEN * wanted, (
            f"{new} new {what} within {wanted:.0f} periods of {1e3 * harness.feedback_s:g} ms"
        )


@pytest.mark.clause("AxisDriver.read/fresh")
@pytest.mark.clause("AxisDriver.read/taken")
def test_a_time_stamp_is_that_of_its_values(harness: Harness) -> None:
    """Values and their time change together: the age of a value is known."""
    values: list[tuple[int, float]] = []
    targets = harness.image.position_command + harness.travel()
    with harness.each_period(
        lambda image: values.append((image.fresh_ns, float(image.position[0])))
    ):
        harness.move(harness.all, targets)
        harness.rest()
    stamps, positions = np.array([stamp for stamp, _ in values]), np.array(values)[:, 1]
    fresh, moved = np.diff(stamps) > 0, np.diff(positions) != 0
    undated = (moved & ~fresh).sum() / max(1, moved.sum())
    assert undated <= UNDATED, f"{undated:.0%} of the values changed and their time did not"
    passed = np.abs(positions - positions[0]) / np.abs(positions[-1] - positions[0])
    begin, end = np.argmax(passed > 0.2), np.argmax(passed > 0.8)
    held = (fresh & ~moved)[begin:end].sum() / max(1, fresh[begin:end].sum())
    assert held <= HELD, f"{held:.0%} of the time stamps are newer than their values"


@pytest.mark.clause("AxisDriver.read/measured", "AxisDriver.read/commands")
@pytest.mark.clause("FaultInjector.position/shaft", "FaultInjector.block/held")
@pytest.mark.short_period
def test_a_blocked_axis_is_measured_where_it_is(fresh: Harness) -> None:
    injector = fresh.injector
    start = fresh.image.position.copy()
    shaft = injector.position(0)
    injector.block(0, True)
    fresh.move([0], start + fresh.travel())
    seen = []
    for _ in range(40):
        fresh.periods(2)
        seen.append((fresh.image.position[0], fresh.image.position_command[0],
                     fresh.image.velocity[0], injector.position(0)))  # fmt: skip
        if fresh.image.amp_alarm[0] or abs(fresh.image.position_command[0] - start[0]) > 0.04:
            break
    position, command, velocity, real = np.array(seen).T
    injector.block(0, False)
    assert np.abs(command - start[0]).max() > 2 * SETTLED_RAD, "the command does not move"
    assert np.abs(position - start[0]).max() <= SETTLED_RAD, "the position is that of the command"
    assert np.abs(velocity[1:]).max() <= 0.05, "the velocity is that of the command"
    assert np.abs(real - shaft).max() <= SETTLED_RAD, "the fault injector shows the command"


@pytest.mark.clause("FaultInjector.jump_encoder/jumps")
@pytest.mark.clause("AxisDriver.read/measured")
def test_a_jump_of_the_encoder_is_seen(disabled: Harness) -> None:
    injector = disabled.injector
    before = disabled.image.position.copy()
    injector.jump_encoder(0, 0.02)
    disabled.periods(5)
    before[0] += 0.02
    assert disabled.image.position == pytest.approx(before, abs=SETTLED_RAD)


@pytest.mark.clause("AxisDriver.read/torque", "AxisDriver.read/nan")
@pytest.mark.needs(Capability.SIMULATED)
def test_torque_pushes_the_way_the_axis_accelerates_or_is_not_known(harness: Harness) -> None:
    """One axis at a time; weight and friction need torques of their own."""
    for axis in harness.all:
        if np.isnan(harness.image.torque[axis]):
            continue
        samples, start = list[tuple[float, ...]](), harness.image.position_command.copy()

        def look(image: ProcessImage, axis: int = axis, samples: list[Any] = samples) -> None:
            samples.append((image.torque[axis], image.position[axis], image.velocity_command[axis]))

        with harness.each_period(look):
            for target in (start + harness.travel(), start):
                harness.move([axis], target)
                harness.rest([axis])
        torque, position, speed = np.array(samples).T
        change = np.gradient(speed)
        # Weight changes with the position, friction with the speed and its sign.
        parts = [np.ones_like(speed), position, speed, np.sign(speed), change]
        factors = np.linalg.lstsq(np.array(parts).T, torque, rcond=None)[0]
        share = float(factors[-1] * np.abs(change).max() / max(np.ptp(torque), 1e-12))
        assert share > ACCELERATING_SHARE, (
            f"axis {axis}: torque has the wrong sign, or is 0 instead of NaN ({share:.3f})"
        )


@pytest.mark.clause("FaultInjector.torque/torque")
@pytest.mark.clause("AxisDriver.read/torque")
def test_torque_is_in_newton_metres(harness: Harness, injector: FaultInjector) -> None:
    """Checks a gentle ramp, and nearly the steepest one that the limits allow."""
    if np.isnan(harness.image.torque).all():
        pytest.skip(f"the {harness.robot.backend.name} backend measures no torque")
    begin = harness.image.position_command.copy()
    for targets, profiles in (
        (begin + harness.travel(), [harness.profile(axis, 0.5) for axis in harness.all]),
        (begin, [steep(harness, axis, STEEP) for axis in harness.all]),
    ):
        shown, exerted = [], []
        harness.move(harness.all, targets, profiles)
        for _ in range(200):
            harness.periods(1)
            shown.append(harness.image.torque.copy())
            exerted.append([injector.torque(axis) for axis in harness.all])
        harness.rest()
        measured, real = np.array(shown), np.array(exerted)
        for axis in np.flatnonzero(np.isfinite(measured).all(0)):
            strong = np.abs(real[:, axis]) >= STRONG * np.abs(real[:, axis]).max()
            size = (real[strong, axis] ** 2).sum()
            gain = float((measured[strong, axis] * real[strong, axis]).sum() / size)
            assert gain == pytest.approx(1.0, abs=0.2), f"axis {axis}: {gain:.3g} shown for 1 N·m"


@pytest.mark.clause("AxisDriver.read/alarms")
@pytest.mark.parametrize("code", CODES)
def test_a_code_is_shown_in_full_with_a_reason(harness: Harness, code: int) -> None:
    harness.trip(code)
    harness.periods(5)
    assert harness.image.alarm_code[0] == code
    reason = harness.image.reason[0]
    assert reason == reason.strip()
    assert not reason or A_WORD.search(reason), f"{reason!r} has no word"
    assert reason.lower().rstrip(".!") not in EMPTY_WORDS, f"{reason!r} says nothing"


@pytest.mark.clause("AxisDriver.read/alarms")
@pytest.mark.clause("FaultInjector.trip/until")
def test_the_code_is_that_of_the_present_alarm(harness: Harness) -> None:
    for code in CODES:
        harness.trip(code)
        harness.periods(5)
        assert harness.image.alarm_code[0] == code
        harness.robot.axes.clear_alarm(0)
        harness.until(lambda: not harness.image.amp_alarm[0], "the alarm is cleared", 1.0)


@pytest.mark.clause("AxisDriver.read/alarms")
def test_an_alarm_stays_however_long_it_takes(harness: Harness) -> None:
    harness.trip(CODES[0])
    harness.periods(5)
    shown = set[tuple[bool, int]]()
    with harness.each_period(
        lambda image: shown.add((bool(image.amp_alarm[0]), int(image.alarm_code[0])))
    ):
        harness.pass_time(LONG_STEPPED_S if harness.stepped else LONG_S)
    assert shown == {(True, CODES[0])}, "the alarm went away by itself"


@pytest.mark.clause("AxisDriver.servo/switches")
def test_switching_on_clears_no_alarm(harness: Harness) -> None:
    harness.trip(CODES[0])
    try:
        harness.drivers.axes.servo(0, True, 1.0)
    except Exception:  # noqa: BLE001 - rejected, in whatever words
        harness.periods(3)
    assert harness.image.amp_alarm[0], "switching on cleared the alarm"
