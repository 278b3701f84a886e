"""Trajectories: they arrive, follow their path, and begin and end without a jump."""

from __future__ import annotations

from itertools import count

import numpy as np
import pytest

from robotd.api import ProcessImage
from robotd.api.robots import Outcome
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import judge, sample_span_s
from robotd_conformance.checks.recording import MotionSamples

LAG_S = 0.03  # granted between the path and the measured position
MORE = 1.15  # what a value may be above its limit
STANDS_AFTER_S, STANDS_S = 0.5, 0.05
LEAP = 3.0  # times the fastest of the path; what is made good within a period is faster
GENTLE_S = 4.0
ENDING = 1.1  # acceleration at the end of the path out and back, times step² / travel
STOP_MORE, STOP_REACTION_S = 2.0, 0.15  # a stop may brake more gently where its path turns
MORE_IN_REAL_TIME = 1.5  # setpoints then come a fraction of a period early or late


def check_smooth(harness: Harness, recording: MotionSamples) -> None:
    """Commands and measured values change no faster than the limits of each joint allow."""
    limits, found = harness.robot.follower.limits, []
    more = MORE if harness.stepped else MORE_IN_REAL_TIME
    _, speeds = recording.slope(recording.position, sample_span_s(harness))
    _, ramps = recording.slope(recording.velocity_command, 0.02, commanded=True)
    for joint, axis in enumerate(harness.joints):
        speed, ramp = np.abs(speeds[:, axis]).max(), np.abs(ramps[:, axis]).max()
        if speed > more * limits.velocity[joint] + 0.01:
            found.append(f"{limits.names[joint]}: {speed:.3g} rad/s on the way")
        if ramp > more * limits.acceleration[joint] + 0.01:
            found.append(f"{limits.names[joint]}: {ramp:.3g} rad/s² on the way")
    judge(harness, recording, found)


@pytest.mark.clause("AxisDriver.end_stream/holds", "AxisDriver.begin_stream/operation")
def test_a_trajectory_arrives(harness: Harness, joints: list[int]) -> None:
    goal = harness.image.position_command + harness.travel()
    with harness.recording() as recording:
        execution = harness.follow([1.2], [harness.travel()[joints]])
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    harness.rest()
    assert not harness.off_target(goal, joints)
    check_smooth(harness, recording)


@pytest.mark.clause("AxisDriver.stream/position", "AxisDriver.follow/starts")
def test_the_joints_are_on_the_path(harness: Harness, joints: list[int]) -> None:
    travel = harness.travel()[joints]
    accelerations = np.array([harness.robot.axes.limits[joint].acceleration for joint in joints])
    step_s = max(0.25, float(np.sqrt(ENDING * np.abs(travel) / accelerations).max()))
    phases = np.linspace(0.0, np.pi, 13)[1:]
    rows = [travel * np.sin(phase) for phase in phases]
    times_s = [step_s * (index + 1) for index in range(len(rows))]
    limits = harness.pose.tolerance[joints] + 1.5 * LAG_S * np.abs(travel) * np.pi / times_s[-1]
    with harness.recording() as recording:
        execution = harness.follow(times_s, rows, velocities=True)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    names, errors = harness.robot.joint_names, execution.max_error
    beyond = np.flatnonzero(errors > limits)
    judge(harness, recording, [f"{names[joint]}: {errors[joint]:.3g} rad" for joint in beyond])


@pytest.mark.clause("AxisDriver.stream/others")
def test_bare_axes_do_not_move_with_the_joints(harness: Harness, joints: list[int]) -> None:
    others = [axis for axis in harness.all if axis not in joints]
    if not others:
        pytest.skip(f"the robot {harness.robot.descriptor.name} has no axis that is not a joint")
    with harness.recording() as recording:
        harness.follow([0.8], [harness.travel()[joints]])
    start = recording.position[0, others]
    assert np.abs(recording.position[:, others] - start).max() <= SETTLED_RAD
    assert np.isfinite(recording.position_command).all()


@pytest.mark.clause("AxisDriver.begin_stream/follows")
def test_a_stream_begins_where_the_command_stands(harness: Harness) -> None:
    start = harness.image.position.copy()
    with harness.recording() as recording, harness.robot.axes.claimed("conformance", harness.all):
        harness.pass_time(0.2)
    assert np.abs(recording.position - start).max() <= SETTLED_RAD


@pytest.mark.clause("AxisDriver.end_stream/holds")
def test_the_end_of_a_trajectory_is_held(harness: Harness, joints: list[int]) -> None:
    harness.follow([0.8], [harness.travel(0.5)[joints]])
    harness.rest()
    with harness.recording() as recording:
        harness.pass_time(0.4)
    assert np.ptp(recording.position, 0).max() <= SETTLED_RAD
    assert np.ptp(recording.position_command, 0).max() <= SETTLED_RAD


@pytest.mark.clause("AxisDriver.stream/setpoint")
@pytest.mark.clause("AxisDriver.stream/position")
@pytest.mark.clause("AxisDriver.stop_trajectory/starts")
def test_a_canceled_trajectory_stops_within_the_limits(harness: Harness, joints: list[int]) -> None:
    with (
        harness.recording() as recording,
        harness.following([1.2], [harness.travel()[joints]]) as execution,
    ):
        harness.pass_time(0.6)
        execution.cancel()
        harness.until(lambda: execution.done, "the trajectory is stopped")
    assert execution.outcome is Outcome.CANCELED
    harness.rest()
    check_smooth(harness, recording)


@pytest.mark.clause("AxisDriver.follow/stops", "AxisDriver.stop_trajectory/starts")
def test_a_gentle_trajectory_is_stopped_as_fast_as_any_other(
    harness: Harness, joints: list[int]
) -> None:
    """The joints' limits say how long a stop takes, not the goal's own acceleration."""
    with harness.following([GENTLE_S], [harness.travel()[joints]]) as execution:
        harness.pass_time(0.4 * GENTLE_S)
        speed = np.abs(harness.image.velocity_command[joints])
        ramp_s = float((speed / harness.robot.follower.limits.acceleration).max())
        execution.cancel()
        with harness.recording() as recording:
            harness.until(lambda: execution.done, "the trajectory is stopped")
    assert execution.outcome is Outcome.CANCELED
    harness.rest()
    moving = np.abs(recording.velocity_command[:, joints]) > 0.02 * speed
    rest_s = recording.time_s[np.flatnonzero(moving.any(1))[-1:]].sum()
    assert speed.min() > 0.0
    assert rest_s <= STOP_MORE * ramp_s + STOP_REACTION_S


@pytest.mark.clause("AxisDriver.begin_stream/follows")
def test_a_new_goal_takes_over_without_a_jump(harness: Harness, joints: list[int]) -> None:
    travel = harness.travel()[joints]
    with harness.recording() as recording, harness.following([1.2], [travel]) as first:
        harness.pass_time(0.5)
        with harness.following([1.0], [-0.3 * travel]) as second:
            harness.until(lambda: second.done, "the second trajectory ends")
    assert first.outcome is Outcome.PREEMPTED
    assert second.outcome is Outcome.SUCCEEDED, second.message
    check_smooth(harness, recording)


@pytest.mark.clause("AxisDriver.underrun/underrun")
def test_no_joint_leaps_after_the_cycle_has_stood(harness: Harness, joints: list[int]) -> None:
    """``AxisDriver.underrun`` says where a joint is by then."""
    periods = count()

    def stand_once(image: ProcessImage) -> None:
        if next(periods) == round(STANDS_AFTER_S / harness.period_s):
            harness.robot.control_loop.delay(STANDS_S)

    with (
        harness.recording() as recording,
        harness.following([1.2], [harness.travel()[joints]]) as execution,
        harness.each_period(stand_once),
    ):
        harness.until(lambda: execution.done, "the trajectory ends")
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert np.diff(recording.time_s).max() > STANDS_S / 2
    times_s = np.linspace(0.0, execution.trajectory.duration_s, 100)
    path = np.abs(execution.trajectory.evaluate(times_s)[1]).max(0)
    _, speeds = recording.slope(recording.position, sample_span_s(harness))
    fastest = np.abs(speeds[:, joints]).max(0)
    for name, speed, meant in zip(harness.robot.joint_names, fastest, path, strict=True):
        assert speed <= LEAP * meant, f"{name}: {speed:.3g} rad/s on a path of {meant:.3g}"


@pytest.mark.clause("AxisDriver.begin_stream/follows", "AxisDriver.follow/starts")
def test_trajectories_may_follow_at_once_on_each_other(harness: Harness, joints: list[int]) -> None:
    travel = harness.travel(0.3)[joints]
    for sign in (1.0, -1.0, 1.0):
        execution = harness.follow([0.5], [sign * travel])
        assert execution.outcome is Outcome.SUCCEEDED, execution.message


@pytest.mark.clause("AxisDriver.end_stream/moves")
def test_an_axis_takes_moves_after_a_trajectory(harness: Harness, joints: list[int]) -> None:
    harness.follow([0.5], [harness.travel(0.3)[joints]])
    harness.rest()
    targets = harness.image.position_command - harness.travel(0.3)
    harness.move(harness.all, targets)
    harness.rest()
    assert not harness.off_target(targets)
