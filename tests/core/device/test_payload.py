"""Payload: what is rejected, and that it is set at rest only."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from tests.core.device.harness import PROFILE, Harness

from robotd import open_robot
from robotd.api.robots import Robot, SteppedClock
from robotd.device.axes import Move
from robotd.device.payload import Payload, PayloadDriver, PayloadSetting
from robotd.errors import InvalidArgument, NotReady, Unsupported
from robotd.events import EventKind


class Scales(PayloadDriver):
    """A device that takes 2 kg."""

    max_kg = 2.0

    def __init__(self) -> None:
        self.now = Payload(0.0)

    def payload(self) -> Payload:
        return self.now

    def set_payload(self, payload: Payload, timeout_s: float) -> None:
        self.now = payload


@pytest.fixture
def setting(harness: Harness) -> PayloadSetting:
    return PayloadSetting(Scales(), harness.axes, [0, 1])


@pytest.mark.parametrize(
    ("payload", "text"),
    [
        (Payload(2.1), r"^payload: 2.1 kg, must be 0 or more and 2 kg at most$"),
        (Payload(-0.1), r"^payload: -0.1 kg, must be"),
        (Payload(math.nan), r"^payload: nan kg, must be"),
        (Payload(1.0, (0.0, 0.0, 60.0)), r"z of its centre is 60 m, at most 2 m from the flange$"),
        (Payload(1.0, (math.nan, 0.0, 0.0)), r"x of its centre is nan m"),
    ],
)
def test_what_no_arm_carries_is_rejected(
    setting: PayloadSetting, payload: Payload, text: str
) -> None:
    with pytest.raises(InvalidArgument, match=text):
        setting.set_payload(payload)
    assert setting.current() == Payload(0.0)


def test_a_mass_without_a_limit_is_finite(harness: Harness) -> None:
    scales = Scales()
    scales.max_kg = math.inf
    with pytest.raises(InvalidArgument, match="inf kg, must be 0 or more and finite"):
        PayloadSetting(scales, harness.axes, [0]).set_payload(Payload(math.inf))


def test_it_is_rejected_while_a_joint_moves(harness: Harness, setting: PayloadSetting) -> None:
    harness.axes.move([Move(1, 0.5, PROFILE)])
    harness.refresh()
    with pytest.raises(NotReady, match="setting the payload needs an idle axis, this one is in"):
        setting.set_payload(Payload(1.0))
    assert setting.current() == Payload(0.0)


def test_another_axis_may_move(harness: Harness, setting: PayloadSetting) -> None:
    harness.axes.move([Move(2, 0.5, PROFILE)])  # a wheel
    harness.refresh()
    setting.set_payload(Payload(1.0))
    assert setting.current() == Payload(1.0)


def test_it_is_rejected_while_a_joint_has_an_owner(
    harness: Harness, setting: PayloadSetting
) -> None:
    with harness.axes.claimed("a goal", [0]):
        harness.refresh()
        with pytest.raises(NotReady, match="joint1: in use by a goal"):
            setting.set_payload(Payload(1.0))


def test_a_backend_without_one_says_so(harness: Harness) -> None:
    without = PayloadSetting(None, harness.axes, [0])
    for command in (without.current, lambda: without.set_payload(Payload(1.0))):
        with pytest.raises(Unsupported, match="a payload: not supported by the"):
            command()


@pytest.fixture
def robot() -> Iterator[Robot]:
    with open_robot("cr3a", "sim", clock=SteppedClock()) as robot:
        yield robot


def test_it_is_noted_and_gone_with_the_device(robot: Robot) -> None:
    robot.payload.set_payload(Payload(0.8, (0.0, 0.0, 0.06)))
    events = robot.events.since(0)[0]
    texts = [event.text for event in events if event.kind is EventKind.COMMAND]
    assert texts[-1] == "set payload: payload 0.8 kg at x 0, y 0, z 0.06 m of the flange"
    robot.connection.close()
    assert robot.payload.current() == Payload(0.0)
