"""Limits of a device and limits of a robot's file: the smaller ones are in force everywhere."""

from __future__ import annotations

from dataclasses import replace

import pytest
from tests.core.control.harness import Harness, arm
from tests.fakes import FakeAxes

from robotd.control.groups.descriptor_limits import fit_device
from robotd.descriptor import load_robot_descriptor
from robotd.device.axes import Move
from robotd.errors import DescriptorError, InvalidArgument, PluginError
from robotd.motion import TrajectoryRejected
from robotd.motion.limits import AxisLimits
from robotd.motion.profile import Profile
from robotd_sim import SimAxes

DEVICE = AxisLimits(-1.0, 9.0, 2.0, 99.0)
MOVE = Profile(1.0, 5.0, 5.0)


class LimitedAxes(FakeAxes):
    """Fake axes of a device with limits."""

    def __init__(self, *limits: AxisLimits, feedback_period_s: float = 0.0) -> None:
        super().__init__(len(limits))
        self._limits, self._period_s = limits, feedback_period_s

    @property
    def device_limits(self) -> tuple[AxisLimits, ...]:
        return self._limits

    @property
    def feedback_period_s(self) -> float:
        return self._period_s


@pytest.fixture
def limited(monkeypatch: pytest.MonkeyPatch) -> Harness:
    """An arm of ±3 rad, 3 rad/s and 12 rad/s² on a device with smaller limits."""
    limits = (DEVICE, DEVICE, replace(DEVICE, acceleration=6.0))
    monkeypatch.setattr(SimAxes, "device_limits", limits, raising=False)
    return Harness().up()


def test_each_value_is_the_smaller_one() -> None:
    limits, notes = fit_device(arm(1), LimitedAxes(DEVICE), "acme")
    assert limits == [AxisLimits(-1.0, 3.0, 2.0, 12.0)]
    assert notes == [
        "joint1: lower limit -3 rad exceeds the device's -1 rad",
        "joint1: velocity 3 rad/s exceeds the device's 2 rad/s",
    ]


def test_an_axis_that_is_no_joint_has_the_limits_of_the_device_alone() -> None:
    descriptor = arm(1, axes=2)
    limits, notes = fit_device(descriptor, LimitedAxes(DEVICE, DEVICE), "acme")
    assert limits[1] == DEVICE
    assert len(notes) == 2


def test_a_device_without_limits_changes_nothing() -> None:
    limits, notes = fit_device(arm(1), FakeAxes(1), "acme")
    assert limits == [AxisLimits(-3.0, 3.0, 3.0, 12.0)]
    assert not notes


def test_ranges_without_a_common_part_are_an_error() -> None:
    away = replace(DEVICE, lower=4.0)
    with pytest.raises(DescriptorError, match=r"joint1: positions -3 to 3 rad and 4 to 9 rad have"):
        fit_device(arm(1), LimitedAxes(away), "acme")
    with pytest.raises(DescriptorError, match="limits in rad and in m"):
        fit_device(arm(1), LimitedAxes(replace(DEVICE, unit="m")), "acme")
    with pytest.raises(PluginError, match="device_limits are of 2 axes, the robot has 1"):
        fit_device(arm(1), LimitedAxes(DEVICE, DEVICE), "acme")


def test_a_wheel_beyond_the_device_is_an_error() -> None:
    with pytest.raises(DescriptorError, match=r"drive: .*wheel.*: velocity .* exceeds"):
        fit_device(load_robot_descriptor("baymax"), LimitedAxes(DEVICE, DEVICE), "acme")


def test_moves_are_checked_against_the_device(limited: Harness) -> None:
    with pytest.raises(InvalidArgument, match=r"joint1: target -1.5 rad is below -1 rad"):
        limited.robot.axes.move([Move(0, -1.5, MOVE)])
    with pytest.raises(InvalidArgument, match=r"velocity 2.5 rad/s exceeds 2 rad/s"):
        limited.robot.axes.move([Move(0, 1.0, replace(MOVE, velocity=2.5))])
    limited.robot.shutdown()


def test_trajectories_have_no_margin_beyond_the_device(limited: Harness) -> None:
    """1.5 rad in 1.09 s peak at 2.06 rad/s: within the margin of 10 %, beyond the device."""
    device = r"velocity 2.06\d* rad/s exceeds 2 rad/s \(limit of the device\)"
    with pytest.raises(TrajectoryRejected, match=f"joint1 at .*{device}"):
        with_goal(limited, 1.5, 0.0, seconds=1.09)
    with_goal(limited, 1.4, 0.0, seconds=1.09)
    ramp = r"acceleration .* exceeds 6 rad/s² \(limit of the device\); allow the motion 1.10 times"
    with pytest.raises(TrajectoryRejected, match=ramp):
        with_goal(limited, 0.0, 1.2, seconds=1.0)
    limited.robot.shutdown()


def test_streams_are_clipped_at_the_device(limited: Harness) -> None:
    with limited.robot.stream() as stream:
        stream.send([2.0, -2.0, 0.0])
        assert stream.statistics.clipped == 1
    limited.robot.shutdown()


def with_goal(harness: Harness, first: float, third: float, seconds: float) -> None:
    with harness.goal([first, 0.0, third], seconds=seconds):
        pass
