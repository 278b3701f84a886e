"""Payload: the device has it, nothing moves, and what cannot be is rejected."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import cast

import numpy as np
import pytest

from robotd.api import Capability, InvalidArgument, Payload, PayloadDriver, RobotdError, Unsupported
from robotd_conformance.checks.harness import SETTLED_RAD, Harness

SMALL = Payload(0.1, (0.0, 0.01, 0.02))  # what any arm carries
LIGHT = Payload(0.0)
RESTORE_S = 5.0

pytestmark = pytest.mark.needs(Capability.PAYLOAD)


Payloads = tuple[Payload, Payload]


@pytest.fixture(autouse=True)
def payloads(harness: Harness) -> Iterator[Payloads]:
    """Two payloads to set in turn; on hardware both are the one that the arm carries.

    With any other one its drives lift it, or let it sink.
    """
    if not harness.can(Capability.PAYLOAD):
        pytest.skip("no payload can be set on this robot")
    carried, simulated = driver_of(harness).payload(), harness.can(Capability.SIMULATED)
    if carried is None and not simulated:
        pytest.skip("the device does not tell what the arm carries, and any other payload moves it")
    carried = carried or LIGHT
    try:
        harness.robot.payload.set_payload(carried)
    except Unsupported as error:  # of this device, where the backend has several
        pytest.skip(str(error))
    yield (SMALL, LIGHT) if simulated else (carried, carried)
    if simulated and harness.robot.connection.ready:
        driver_of(harness).set_payload(carried, RESTORE_S)


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
def test_the_payload_that_was_set_is_shown(harness: Harness, payloads: Payloads) -> None:
    for payload in (*payloads, payloads[0]):
        harness.robot.payload.set_payload(payload)
        require_same(driver_of(harness).payload(), payload)


@pytest.mark.clause("PayloadDriver.set_payload/still")
def test_nothing_moves_and_servos_stay_as_they_are(harness: Harness, payloads: Payloads) -> None:
    harness.rest()
    start = harness.image.position.copy()
    for on in (True, False):
        if not on:
            harness.disable()
            start = harness.image.position.copy()
        for payload in payloads:
            harness.robot.payload.set_payload(payload)
            harness.periods(5)
            assert harness.image.servo_on.all() == on, f"servos are not {'on' if on else 'off'}"
            away = np.abs(harness.image.position - start).max()
            assert away <= SETTLED_RAD, f"an axis has moved by {away:.2g} rad"


@pytest.mark.clause("PayloadDriver.set_payload/holds")
def test_the_payload_holds_while_servos_are_switched(harness: Harness, payloads: Payloads) -> None:
    payload = payloads[0]
    harness.robot.payload.set_payload(payload)
    harness.disable()
    harness.enable()
    harness.periods(5)
    require_same(driver_of(harness).payload(), payload)


@pytest.mark.clause("PayloadDriver.max_kg/most", "PayloadDriver.set_payload/errors")
def test_too_much_is_rejected_and_the_payload_before_holds(
    harness: Harness, payloads: Payloads
) -> None:
    robot, payload = harness.robot, payloads[0]
    robot.payload.set_payload(payload)
    most = robot.payload.max_kg
    assert most > 0.0
    if math.isfinite(most):
        if harness.can(Capability.SIMULATED):
            robot.payload.set_payload(Payload(most, payload.center_m))
            robot.payload.set_payload(payload)
        with pytest.raises(InvalidArgument, match="kg"):
            robot.payload.set_payload(Payload(1.01 * most))
    require_same(driver_of(harness).payload(), payload)


@pytest.mark.clause("PayloadDriver.set_payload/errors")
def test_without_communication_nothing_is_set(harness: Harness, payloads: Payloads) -> None:
    harness.robot.connection.stop_communication()
    with pytest.raises(RobotdError):
        driver_of(harness).set_payload(payloads[0], RESTORE_S)
