from __future__ import annotations

import pytest
from tests.plugins.sim.harness import PROFILE, Harness, harness

from robotd.api import Operation, OperationError, Profile
from robotd_sim.limit_guards import LimitType


def homed(**options: float) -> Harness:
    made = harness()
    made.axes.home(0, 1.0)
    made.set(SoftLimitPositivePos=0.5, SoftLimitNegativePos=-0.5, LSDec=50.0, LSSlowDec=10.0,
             **options)  # fmt: skip
    return made


def test_a_soft_limit_stops_the_axis_and_lets_it_go_back_only() -> None:
    made = homed(SoftLimitType=LimitType.DEC)
    made.axes.move(0, 2.0, PROFILE)
    image = made.look(1.0)
    assert 0.5 < image.position_command[0] < 0.5 + 2.0**2 / 100 + 0.003
    assert image.operation[0] == Operation.IDLE
    assert not image.motion_complete[0]
    assert image.servo_on[0]
    assert image.reason[0].startswith("positive soft limit 0.5 is reached")
    with pytest.raises(OperationError, match=r"axis 0: positive soft limit 0.5 is reached"):
        made.axes.move(0, 1.0, PROFILE)
    made.axes.move(0, -0.4, PROFILE)
    image = made.look(2.0)
    assert image.motion_complete[0]
    assert image.reason == ["", ""]


@pytest.mark.parametrize(
    ("limit", "servo_on", "overrun"),
    [
        (LimitType.SERVO_OFF, False, 2.0**2 / 20),
        (LimitType.DEC_SERVO_OFF, False, 2.0**2 / 100),
        (LimitType.SLOW_DEC_SERVO_OFF, False, 2.0**2 / 20),
        (LimitType.SLOW_DEC, True, 2.0**2 / 20),
    ],
)
def test_the_limit_type_says_how_to_stop(limit: LimitType, servo_on: bool, overrun: float) -> None:
    made = homed(SoftLimitType=limit)
    made.axes.jog(0, Profile(-2.0, 20.0, 20.0))
    image = made.look(1.0)
    assert image.position[0] == pytest.approx(-0.5 - overrun, abs=0.005)
    assert image.reason[0].startswith("negative soft limit -0.5 is reached")
    assert image.servo_on[0] == servo_on
    assert image.operation[0] == Operation.IDLE


def test_each_side_may_have_its_own_type() -> None:
    made = homed(SoftLimitType=LimitType.SEPARATE, NegativeSoftLimitType=LimitType.DEC)
    made.axes.move(0, 1.0, PROFILE)
    assert made.look(2.0).motion_complete[0]  # the positive side has none
    made.axes.move(0, -1.0, PROFILE)
    assert made.look(2.0).position_command[0] > -0.6


def test_soft_limits_sleep_until_the_axis_is_homed() -> None:
    made = harness()
    made.set(SoftLimitPositivePos=0.5, SoftLimitType=LimitType.DEC)
    made.axes.move(0, 1.0, PROFILE)
    assert made.look(2.0).motion_complete[0]


def test_a_limit_switch_shows_in_the_image_and_stops_the_axis() -> None:
    made = harness(
        limit_switches={0: {"positive_rad": 0.8}}, home_switches={0: {"position_rad": 0.4}}
    )
    made.axes.move(0, 0.4, PROFILE)
    image = made.look(2.0)
    assert image.home_switch[0]
    assert not image.positive_limit[0]
    made.axes.move(0, 2.0, PROFILE)
    image = made.look(2.0)
    assert image.positive_limit[0]
    assert not image.negative_limit[0]
    assert not image.home_switch[0]
    assert image.position[0] == pytest.approx(0.8, abs=0.01)  # LSDec is 10000 by default
    with pytest.raises(OperationError, match=r"positive limit switch at 0.8 is reached"):
        made.axes.jog(0, PROFILE)
    made.axes.jog(0, Profile(-1.0, 10.0, 10.0))
    assert not made.look(0.5).positive_limit[0]


@pytest.mark.parametrize(("switch", "sign"), [("positive_limit", 1), ("negative_limit", -1)])
def test_a_switch_that_closes_in_motion_stops_the_axis(switch: str, sign: int) -> None:
    made = harness()
    made.axes.jog(0, Profile(sign * 1.0, 10.0, 10.0))
    before = made.look(0.5).position[0]
    made.faults.press_switch(0, switch, True)
    image = made.look(0.5)
    assert image.operation[0] == Operation.IDLE
    assert image.reason[0] == f"{switch.removesuffix('_limit')} limit switch is closed"
    assert image.position[0] == pytest.approx(before, abs=0.01)


def test_too_large_a_following_error_stops_the_axis() -> None:
    made = harness()
    made.set(FollowingErrorType=1, FollowingErrorMoving=0.0004, QuickStopDec=100.0)
    made.axes.move(0, 0.5, Profile(1.0, 8.0, 8.0))  # 0.32 mrad behind
    assert made.look(2.0).motion_complete[0]
    made.axes.move(0, -1.0, Profile(2.0, 8.0, 8.0))  # 0.64 mrad behind
    image = made.look(2.0)
    assert image.operation[0] == Operation.IDLE
    assert not image.motion_complete[0]
    assert image.position[0] > 0
    assert image.reason == ["following error 0.000402 is above 0.0004", ""]
    made.axes.clear_alarm(0, 1.0)
    assert made.look().reason == ["", ""]
    made.axes.move(0, -1.0, Profile(1.0, 8.0, 8.0))
    assert made.look(3.0).motion_complete[0]


def test_each_command_of_an_axis_that_does_not_follow_is_stopped() -> None:
    made = harness()
    made.set(FollowingErrorType=1, FollowingErrorMoving=0.01, FollowingErrorStopped=0.02)
    made.faults.block(0, True)
    for _ in range(2):  # the second one without an acknowledgement of the alarm
        made.axes.move(0, 1.0, PROFILE)
        image = made.look(2.0)
        assert image.operation[0] == Operation.IDLE
        assert image.reason[0].startswith("following error 0.01")
        assert image.position_command[0] < 0.05
