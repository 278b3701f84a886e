"""Messages to commands and results to messages, without ROS running."""

from __future__ import annotations

import warnings
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

with warnings.catch_warnings():  # rosidl imports an old lark
    warnings.simplefilter("ignore", DeprecationWarning)
    import rosidl_generator_py  # noqa: F401

from builtin_interfaces.msg import Duration, Time
from control_msgs.action import FollowJointTrajectory
from rclpy.serialization import serialize_message
from trajectory_msgs.msg import JointTrajectoryPoint
from wmx_ros2_message.msg import AxisPose, AxisVelocity
from wmx_ros2_message.srv import SetAxis

from robotd.errors import InvalidArgument
from robotd.motion import TrajectoryRejected
from robotd.motion.profile import Profile
from robotd.motion.rejection import RejectionCode
from robotd_ros.nodes import axis_conversions
from robotd_ros.nodes.trajectory_conversions import (
    stamp_ns,
    trajectory_request,
)
from robotd_ros.trajectory_messages import duration_s


def test_parameters_are_lines_under_the_number_of_their_axis() -> None:
    lines = axis_conversions.parameter_lines(3, "GearRatio = 2\nPolarity = 1")
    assert lines == ["=== Axis 3 ===", "GearRatio = 2", "Polarity = 1", ""]


def test_moves_keep_axis_and_numbers_together() -> None:
    message = AxisPose(
        index=[3, 0], target=[0.5, -0.5], velocity=[1.0, 2.0], acc=[3.0, 4.0], dec=[5.0, 6.0]
    )
    first, second = axis_conversions.moves(message)
    assert (first.axis, first.target, first.profile) == (3, 0.5, Profile(1.0, 3.0, 5.0))
    assert (second.axis, second.target, second.profile) == (0, -0.5, Profile(2.0, 4.0, 6.0))


@pytest.mark.parametrize("short", ["velocity", "acc", "dec"])
def test_a_short_column_is_named(short: str) -> None:
    columns = {"velocity": [1.0, 1.0], "acc": [1.0, 1.0], "dec": [1.0, 1.0]} | {short: [1.0]}
    with pytest.raises(InvalidArgument, match=f"{short} has 1 values for 2 axes"):
        axis_conversions.jogs(AxisVelocity(index=[0, 1], **columns))


def test_outcome_names_every_axis_once() -> None:
    results: dict[int, Exception | None] = {
        2: None,
        0: InvalidArgument("mode 9 is unknown", axis=0),
        1: InvalidArgument("in use"),
    }
    names = ("joint1", "joint2", "joint3")
    response = axis_conversions.fill_outcome(SetAxis.Response(), names, results)
    assert not response.success
    assert response.message == "joint3: ok; joint1: mode 9 is unknown; joint2: in use"
    assert axis_conversions.fill_outcome(SetAxis.Response(), names, {1: None}).success


def test_outcome_names_what_was_switched_too() -> None:
    notes = {0: " (one servo switch with joint2)"}
    names = ("joint1", "joint2")
    response = axis_conversions.fill_outcome(SetAxis.Response(), names, {0: None}, notes)
    assert response.message == "joint1: ok (one servo switch with joint2)"


def goal(**point: Any) -> Any:
    message = FollowJointTrajectory.Goal()
    message.trajectory.joint_names = ["a", "b"]
    message.trajectory.points = [
        JointTrajectoryPoint(time_from_start=Duration(sec=2, nanosec=500_000_000), **point)
    ]
    return message


def test_trajectory_request_takes_every_column() -> None:
    request = trajectory_request(
        goal(positions=[1.0, 2.0], velocities=[3.0, 4.0], accelerations=[5.0, 6.0]).trajectory
    )
    assert request.joint_names == ("a", "b")
    assert request.times_s.tolist() == [2.5]
    assert request.positions.tolist() == [[1.0, 2.0]]
    assert request.velocities is not None
    assert request.accelerations is not None
    assert request.velocities.tolist() == [[3.0, 4.0]]
    assert request.accelerations.tolist() == [[5.0, 6.0]]


def test_a_trajectory_without_joints_has_the_code_of_joints() -> None:
    message = goal(positions=[1.0, 2.0])
    message.trajectory.joint_names = []
    with pytest.raises(TrajectoryRejected) as rejection:
        trajectory_request(message.trajectory)
    assert rejection.value.code is RejectionCode.INVALID_JOINTS


def test_effort_is_rejected_rather_than_ignored() -> None:
    with pytest.raises(TrajectoryRejected, match="effort"):
        trajectory_request(goal(positions=[1.0, 2.0], effort=[1.0, 1.0]).trajectory)


@given(st.integers(-(2**31), 2**31 - 1), st.integers(0, 999_999_999))
def test_times(sec: int, nanosec: int) -> None:
    assert stamp_ns(Time(sec=sec, nanosec=nanosec)) == sec * 10**9 + nanosec
    expected = pytest.approx(sec + nanosec / 1e9)
    assert duration_s(Duration(sec=sec, nanosec=nanosec)) == expected


@pytest.mark.parametrize("message_type", [AxisVelocity, AxisPose])
def test_axes_of_a_serialized_message(message_type: Any) -> None:
    def axes(*index: int) -> frozenset[int]:
        message = message_type(index=index, velocity=[0.5] * len(index))
        return axis_conversions.axes_of(serialize_message(message), 4)

    assert axes(2) == {2}
    assert axes(3, 0) == {0, 3}
    for rejected in ((), (4,), (1, -1), (1, 2**31 - 1)):
        assert axes(*rejected) == axis_conversions.NO_AXES
    assert axes(0, 1, 2, 3, 9) == {0, 1, 2, 3}  # rejected as well, with all of its axes
    assert axes(*[1] * 100_000) == {1}


@given(st.binary(max_size=64))
def test_no_bytes_are_too_few_for_axes(data: bytes) -> None:
    assert axis_conversions.axes_of(data, 4) <= frozenset(range(-1, 4))
