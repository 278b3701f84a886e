"""Payload: the device has it, nothing moves, and what cannot be is rejected."""

from __future__ import annotations

import math
from typing import cast

import numpy as np
import pytest

from robotd.api import Capability, InvalidArgument, Payload, PayloadDriver, RobotdError, Unsupported
from robotd_conformance.checks.harness import SETTLED_RAD, Harness

SMALL = Payload(0.1, (0.0, 0.01, 0.02))  # what any arm carries
LIGHT = Payload(0.0)

pytestmark = pytest.mark.needs(Capability.PAYLOAD)


@pytest.fixture(autouse=True)
def _payload_of_the_robot(harness: Harness) -> None:
    if not harness.can(Capability.PAYLOAD):
        pytest.skip("no payload can be set on this robot")
    try:
        harness.robot.payload.set_payload(LIGHT)
    except Unsupported as error:  # of this device, where the backend has several
        pytest.skip(str(error))


def driver_of(harness: Harness) -> PayloadDriver:
    return cast(PayloadDriver, harness.drivers.payload)


def require_same(found: Payload | None, payload: Payload) -> None:
    """Raise AssertionError where the driver shows another one; it may show none."""
    if found is not None:
        values = (found.mass_kg, *found.center_m)
        assert values == pytest.approx((payload.mass_kg, *payload.center_m), abs=1e-3), (
            f"the driver shows {found}, {payload} was set"
        )


@pytest.mark.clause("PayloadDriver.set_payload/sets", "PayloadDriver.payload/shows")
def test_the_payload_that_was_set_is_shown(harness: Harness) -> None:
    for payload in (SMALL, LIGHT, SMALL):
        harness.robot.payload.set_payload(payload)
        require_same(driver_of(harness).payload(), payload)


@pytest.mark.clause("PayloadDriver.set_payload/still")
def test_nothing_moves_and_servos_stay_as_they_are(harness: Harness) -> None:
    harness.rest()
    start = harness.image.position.copy()
    for on in (True, False):
        if not on:
            harness.disable()
            start = harness.image.position.copy()
        for payload in (SMALL, LIGHT):
            harness.robot.payload.set_payload(payload)
            harness.periods(5)
            assert harness.image.servo_on.all() == on, f"servos are not {'on' if on else 'off'}"
            away = np.abs(harness.image.position - start).max()
            assert away <= SETTLED_RAD, f"an axis has moved by {away:.2g} rad"


@pytest.mark.clause("PayloadDriver.set_payload/holds")
def test_the_payload_holds_while_servos_are_switched(harness: Harness) -> None:
    harness.robot.payload.set_payload(SMALL)
    harness.disable()
    harness.enable()
    harness.periods(5)
    require_same(driver_of(harness).payload(), SMALL)
    harness.robot.payload.set_payload(LIGHT)


@pytest.mark.clause("PayloadDriver.max_kg/most", "PayloadDriver.set_payload/errors")
def test_too_much_is_rejected_and_the_payload_before_holds(harness: Harness) -> None:
    robot = harness.robot
    robot.payload.set_payload(SMALL)
    most = robot.payload.max_kg
    assert most > 0.0
    if math.isfinite(most):
        robot.payload.set_payload(Payload(most, SMALL.center_m))
        robot.payload.set_payload(SMALL)
        with pytest.raises(InvalidArgument, match="kg"):
            robot.payload.set_payload(Payload(1.01 * most))
    require_same(driver_of(harness).payload(), SMALL)
    robot.payload.set_payload(LIGHT)


@pytest.mark.clause("PayloadDriver.set_payload/errors")
def test_without_communication_nothing_is_set(harness: Harness) -> None:
    harness.robot.connection.stop_communication()
    with pytest.raises(RobotdError):
        driver_of(harness).set_payload(SMALL, 5.0)
