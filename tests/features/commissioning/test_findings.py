"""Judgements of measured values."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotd.descriptor.joint_settings import JointSettings
from robotd.device.bus_status import BusNode, BusState
from robotd.errors import OperationError
from robotd_commissioning.findings import (
    Change,
    DescriptorPart,
    StepFinding,
    in_words,
    judge_brake,
    judge_direction,
    judge_following_error,
    judge_identity,
    judge_limits,
    judge_scale,
)

JOINT = JointSettings(
    name="shoulder",
    axis=0,
    lower_rad=-1.0,
    upper_rad=1.0,
    velocity_rad_s=2.0,
    acceleration_rad_s2=8.0,
)
SLIDE = JointSettings(
    name="slide", axis=1, type="prismatic", lower_m=0.0, upper_m=0.5, velocity_m_s=1.0,
    acceleration_m_s2=2.0,
)  # fmt: skip
NODE = BusNode(3, BusState.OPERATIONAL, vendor_id=0x0B, product_code=0x2A)


def drive(key: str, value: object) -> tuple[Change, ...]:
    return (Change(DescriptorPart.DRIVE, key, value),)


def direction(reported: float, *, positive: bool, polarity: int = 1) -> StepFinding:
    return judge_direction(
        reported, positive=positive, polarity=polarity, key="polarity", unit="rad"
    )


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(math.pi, "rad", "+180.00°"), (-0.0125, "m", "-12.50 mm"), (-1e-9, "rad", "+0.00°")],
)
def test_positions_are_in_degrees_or_millimetres(value: float, unit: str, text: str) -> None:
    assert in_words(value, unit) == text


def test_an_identity_is_proposed_compared_and_demanded() -> None:
    found = {"vendor_id": 0x0B, "product_code": 0x2A}
    assert judge_identity(NODE, {}, "identity").changes == drive("identity", found)
    assert not judge_identity(NODE, {"vendor_id": 0x0B, "serial": None}, "identity").changes
    with pytest.raises(OperationError, match="demands product_code 0x0000002B: another drive"):
        judge_identity(NODE, {"product_code": 0x2B}, "identity")


def test_a_drive_that_is_offline_has_no_identity() -> None:
    with pytest.raises(OperationError, match="node 3 is offline: no heartbeat"):
        judge_identity(BusNode(3, BusState.UNKNOWN, offline=True, fault="no heartbeat"), {}, "id")


@pytest.mark.parametrize("reported", [0.1, -0.1])
@pytest.mark.parametrize("positive", [True, False])
@pytest.mark.parametrize("polarity", [1, -1])
def test_polarity_changes_when_the_signs_differ(
    reported: float, positive: bool, polarity: int
) -> None:
    changes = direction(reported, positive=positive, polarity=polarity).changes
    assert changes == (() if (reported > 0) is positive else drive("polarity", -polarity))


def test_a_joint_that_did_not_move_has_no_direction() -> None:
    with pytest.raises(OperationError, match="another drive belongs to it"):
        direction(0.001, positive=True)


@given(st.floats(0.1, 3.0), st.floats(1e2, 1e7), st.floats(0.02, 50.0))
def test_the_new_scale_reports_the_true_angle(true: float, right: float, wrong: float) -> None:
    scale = right * wrong
    reported = right * true / scale
    finding = judge_scale(reported, true, scale, "counts_per_rad", "rad")
    new = finding.changes[0].value if finding.changes else scale
    assert right * true / new == pytest.approx(true, rel=0.021)


@pytest.mark.parametrize("factor", [2.0, 0.5, 10.0, 0.1])
def test_a_forgotten_gear_ratio_is_corrected_exactly(factor: float) -> None:
    true = 0.5
    finding = judge_scale(true * factor * 1.01, true, 1000.0, "counts_per_rad", "rad")
    assert finding.changes[0].value == 1000.0 * factor
    assert "wrong by a factor of" in finding.text


@pytest.mark.parametrize(
    ("reported", "true", "text"),
    [(0.01, 0.01, "too little to measure by"), (-0.2, 0.2, "direction is wrong"),
     (0.0, 0.2, "did not move")],
)  # fmt: skip
def test_a_useless_measurement_is_rejected(reported: float, true: float, text: str) -> None:
    with pytest.raises(OperationError, match=text):
        judge_scale(reported, true, 1000.0, "counts_per_rad", "rad")


def test_limits_change_where_the_travel_differs_and_round_inwards() -> None:
    assert not judge_limits(-1.002, 0.998, JOINT).changes
    assert judge_limits(0.70009, -0.50009, JOINT).changes == (
        Change(DescriptorPart.JOINT, "lower_rad", -0.5),
        Change(DescriptorPart.JOINT, "upper_rad", 0.7),
    )
    assert judge_limits(0.0, 0.4, SLIDE).changes == (Change(DescriptorPart.JOINT, "upper_m", 0.4),)
    with pytest.raises(OperationError, match="only"):
        judge_limits(0.1, 0.11, JOINT)


def test_the_window_is_twice_the_error_at_full_speed() -> None:
    finding = judge_following_error(0.05, JOINT, 1000.0, "0x6065")
    assert finding.changes == drive("0x6065", 200)  # 2 · 0.05 s · 2 rad/s · 1000
    assert not judge_following_error(0.05, JOINT, 1000.0, "").changes


def test_a_brake_holds_or_not() -> None:
    assert "it holds" in judge_brake(0.001, "rad").text
    with pytest.raises(OperationError, match=r"moved by -2.00 mm .*limit \+0.50 mm"):
        judge_brake(-0.002, "m")
