"""Enabling and disabling: without a jump, only the axis that is meant, and truthfully."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.device.bench import Bench
from robotd.device.drivers import Profile
from robotd.errors import NotReady, OperationError
from robotd.testing.conformance.rig import SETTLED_RAD, Rig


def disable(rig: Rig) -> None:
    for axis in rig.all:
        rig.robot.axes.servo(axis, False)
    rig.rest()


def test_enabling_does_not_move_the_axis(rig: Rig) -> None:
    disable(rig)
    start = rig.image.position.copy()
    with rig.recording() as recording:
        rig.enable()
        rig.let(0.3)
    assert np.abs(recording.position - start).max() <= SETTLED_RAD


def test_enabling_after_a_move_by_hand_does_not_jump(rig: Rig, bench: Bench) -> None:
    disable(rig)
    for axis, delta in zip(rig.all, rig.travel(), strict=True):
        bench.move_by_hand(axis, float(delta))
    rig.periods(5)
    start = rig.image.position.copy()
    with rig.recording() as recording:
        rig.enable()
        rig.let(0.3)
    assert np.abs(recording.position - start).max() <= SETTLED_RAD
    enabled = recording.servo_on.astype(bool)
    jump = np.abs(recording.position_command - recording.position)[enabled]
    assert jump.max() <= SETTLED_RAD, "the command was not set to the measured position"


def test_a_move_by_hand_is_seen(rig: Rig, bench: Bench) -> None:
    disable(rig)
    start, delta = rig.image.position.copy(), rig.travel(0.5)
    for axis in rig.all:
        bench.move_by_hand(axis, float(delta[axis]))
    rig.periods(5)
    assert rig.image.position == pytest.approx(start + delta, abs=SETTLED_RAD)


def test_servo_returns_when_the_drive_says_so(rig: Rig) -> None:
    driver = rig.parts.driver
    for on in (False, True, True, False, False, True):
        for axis in rig.all:
            driver.servo(axis, on, 5.0)
        rig.periods(2)
        assert (rig.image.servo_on == on).all()


def test_only_the_named_servo_is_switched(rig: Rig) -> None:
    for axis in rig.all:
        rig.robot.axes.servo(axis, False)
        rig.periods(3)
        assert not rig.image.servo_on[axis]
        assert np.delete(rig.image.servo_on, axis).all()
        rig.robot.axes.servo(axis, True)


def test_a_disabled_axis_refuses_to_move(rig: Rig) -> None:
    disable(rig)
    start = rig.image.position.copy()
    with pytest.raises(NotReady):
        rig.move([0], start + rig.travel())
    with pytest.raises(OperationError):
        rig.parts.driver.move(0, float(start[0] + rig.travel()[0]), Profile(0.5, 2.0, 2.0))
    rig.let(0.3)
    assert np.abs(rig.image.position - start).max() <= SETTLED_RAD


def test_an_enabled_axis_holds_its_position(rig: Rig) -> None:
    start = rig.image.position.copy()
    with rig.recording() as recording:
        rig.let(0.5)
    assert np.abs(recording.position - start).max() <= SETTLED_RAD
