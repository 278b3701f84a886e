"""Velocity limits of a drive below that of the joint."""

from __future__ import annotations

import math
from typing import Any

import pytest
from structlog.testing import capture_logs
from tests.plugins.cia402.looped_drive import LoopedDrive

from robotd.api import DeviceTimeout
from robotd_cia402.drive_limits import report_velocity_limits
from robotd_cia402.scaling import Scaling

COUNTS = 1e5  # per rad of the joint
TURN = round(2 * math.pi * COUNTS)
INCREMENTS = {(0x608F, 1): 131072, (0x608F, 2): 1}


def reported(
    objects: dict[tuple[int, int], int], joint: float | None = 3.0, **options: Any
) -> list[dict[str, Any]]:
    """Return the warnings of two starts in a row."""
    looped = LoopedDrive(**options)
    looped.objects.dictionary.update(objects)
    looped.axis.scaling = Scaling(looped.axis.options, None, joint)
    with capture_logs() as lines:
        report_velocity_limits(looped.axis)
        report_velocity_limits(looped.axis)
    return [dict(line) for line in lines]


def test_a_lower_profile_velocity_names_axis_object_value_and_both_limits() -> None:
    [line] = reported({(0x607F, 0): 200_000})
    assert line["log_level"] == "warning"
    assert (line["node"], line["axis"]) == ("joint1 (node 1)", 0)
    assert line["object"] == "0x607F (max profile velocity) is 200000"
    assert (line["clips_at"], line["joint_limit"]) == ("2 rad/s (or m/s)", "3")


def test_the_units_are_those_of_the_profile_velocity() -> None:
    assert not reported({(0x607F, 0): 200_000}, velocity_per_rad_s=1000.0)
    [line] = reported({(0x607F, 0): 2900}, velocity_per_rad_s=1000.0, polarity=-1)
    assert line["clips_at"].startswith("2.9 ")


@pytest.mark.parametrize(
    ("objects", "joint"),
    [
        ({}, 3.0),
        ({(0x607F, 0): 300_000}, 3.0),
        ({(0x607F, 0): 299_999}, 3.0),  # the limit of the joint, rounded
        ({(0x607F, 0): 0}, 3.0),
        ({(0x607F, 0): 1000}, None),
    ],
    ids=["default", "equal", "rounded", "zero", "no joint"],
)
def test_nothing_is_said_of_a_limit_that_does_not_clip(
    objects: dict[tuple[int, int], int], joint: float | None
) -> None:
    assert not reported(objects, joint)


def test_a_drive_without_the_objects_or_without_an_answer_says_nothing() -> None:
    looped = LoopedDrive()
    looped.axis.scaling = Scaling(looped.axis.options, None, 3.0)
    del looped.objects.dictionary[0x607F, 0]
    with capture_logs() as lines:
        report_velocity_limits(looped.axis)

        def mute(index: int, sub: int = 0) -> int:
            raise DeviceTimeout("no answer")

        looped.objects.read = mute  # type: ignore[method-assign]
        report_velocity_limits(looped.axis)
    assert not lines


# A gear of 50 within the drive: 0x6092 and 0x608F x 0x6091 state one turn of the joint.
GEAR = {(0x6091, 1): 50, (0x6091, 2): 1}
BOTH = {**GEAR, (0x6092, 1): TURN, (0x6092, 2): 1, (0x608F, 1): TURN, (0x608F, 2): 50}


def test_a_motor_speed_is_compared_where_two_objects_state_the_same_turn() -> None:
    [line] = reported({(0x6080, 0): 1000, **BOTH})
    assert line["object"] == "0x6080 (max motor speed) is 1000 r/min"
    assert float(line["clips_at"].split()[0]) == pytest.approx(1000 / 60 / 50 * 2 * math.pi, 1e-3)
    assert not reported({(0x6080, 0): 1500, **BOTH}), "3.14 rad/s"


def test_a_motor_speed_is_compared_where_the_scale_of_the_joint_agrees() -> None:
    encoder = {(0x608F, 1): TURN, (0x608F, 2): 1}
    [line] = reported({(0x6080, 0): 20, **encoder})
    assert line["clips_at"].startswith("2.094 ")


@pytest.mark.parametrize(
    "objects",
    [
        {},
        INCREMENTS,  # a gear behind the drive, or a scale that no object states
        {**BOTH, (0x6092, 1): TURN * 2},
        {(0x6092, 1): 1, (0x6092, 2): 1},
    ],
    ids=["nothing stated", "one statement", "they differ", "default"],
)
def test_nothing_is_said_of_a_motor_speed_without_a_sure_scale(
    objects: dict[tuple[int, int], int],
) -> None:
    assert not reported({(0x6080, 0): 1, **objects})
