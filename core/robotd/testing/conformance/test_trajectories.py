"""Trajectories: they arrive, follow their path, and begin and end without a jump."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

import numpy as np
import pytest

from robotd.cycle.execution import Outcome
from robotd.device.image import ProcessImage
from robotd.testing.conformance.attempts import judge
from robotd.testing.conformance.recording import Recording
from robotd.testing.conformance.rig import SETTLED_RAD, Rig

LAG_S = 0.03  # granted between the path and the measured position
MORE = 1.15  # what a value may be above its limit
STANDS_AFTER_S, STANDS_S = 0.5, 0.05
LEAP = 3.0  # times the fastest of the path; what is made good within a period is faster
MORE_IN_REAL_TIME = 1.5  # setpoints then come a fraction of a period early or late


def joint_travel(rig: Rig, share: float = 1.0) -> np.ndarray:
    return rig.travel(share)[list(rig.robot.joint_axes)]


def check_smooth(rig: Rig, motion: Callable[[], Recording]) -> None:
    """Commands and measured values of ``motion`` change no faster than the limits allow."""
    judge(rig, motion, lambda recording: jumps_of(rig, recording))


def jumps_of(rig: Rig, recording: Recording) -> list[str]:
    """What is beyond the limits of each joint, in words."""
    limits, found = rig.robot.follower.limits, []
    more = MORE if rig.stepped else MORE_IN_REAL_TIME
    _, speeds = recording.slope(recording.position, 2 * rig.period_s)
    _, ramps = recording.slope(recording.velocity_command, 0.02)
    for joint, axis in enumerate(rig.robot.joint_axes):
        speed, ramp = np.abs(speeds[:, axis]).max(), np.abs(ramps[:, axis]).max()
        if speed > more * limits.velocity[joint] + 0.01:
            found.append(f"{limits.names[joint]}: {speed:.3g} rad/s on the way")
        if ramp > more * limits.acceleration[joint] + 0.01:
            found.append(f"{limits.names[joint]}: {ramp:.3g} rad/s² on the way")
    return found


def test_a_trajectory_arrives(jointed: Rig) -> None:
    rig, joints = jointed, list(jointed.robot.joint_axes)

    def motion() -> Recording:
        goal = rig.image.position_command[joints] + joint_travel(rig)
        with rig.recording() as recording, rig.following([1.2], [joint_travel(rig)]) as execution:
            rig.until(lambda: execution.done, "the trajectory ends")
        assert execution.outcome is Outcome.SUCCEEDED, execution.message
        rig.rest()
        assert rig.image.position[joints] == pytest.approx(goal, abs=SETTLED_RAD)
        return recording

    check_smooth(rig, motion)


def test_the_joints_are_on_the_path(jointed: Rig) -> None:
    rig, way = jointed, joint_travel(jointed)
    phases = np.linspace(0.0, np.pi, 13)[1:]
    rows = [way * np.sin(phase) for phase in phases]
    times_s = [0.25 * (index + 1) for index in range(len(rows))]
    limits = SETTLED_RAD + 1.5 * LAG_S * np.abs(way) * np.pi / times_s[-1]
    errors = np.zeros(len(way))

    def motion() -> Recording:
        points = rig.following(times_s, rows, velocities=True)
        with rig.recording() as recording, points as execution:
            rig.until(lambda: execution.done, "the trajectory ends")
        assert execution.outcome is Outcome.SUCCEEDED, execution.message
        errors[:] = execution.max_error
        return recording

    def problems(recording: Recording) -> list[str]:
        names = rig.robot.joint_names
        return [
            f"{names[each]}: {errors[each]:.3g} rad" for each in np.flatnonzero(errors > limits)
        ]

    judge(rig, motion, problems)


def test_bare_axes_do_not_move_with_the_joints(jointed: Rig) -> None:
    rig = jointed
    others = [axis for axis in rig.all if axis not in rig.robot.joint_axes]
    if not others:
        pytest.skip(f"the robot {rig.robot.descriptor.name} has no axis that is no joint")
    with rig.recording() as recording, rig.following([0.8], [joint_travel(rig)]) as execution:
        rig.until(lambda: execution.done, "the trajectory ends")
    start = recording.position[0, others]
    assert np.abs(recording.position[:, others] - start).max() <= SETTLED_RAD
    assert np.isfinite(recording.position_command).all()


def test_a_stream_begins_where_the_command_stands(rig: Rig) -> None:
    start = rig.image.position.copy()
    with rig.recording() as recording, rig.robot.axes.claimed("conformance", rig.all):
        rig.let(0.2)
    assert np.abs(recording.position - start).max() <= SETTLED_RAD


def test_the_end_of_a_trajectory_is_held(jointed: Rig) -> None:
    rig = jointed
    with rig.following([0.8], [joint_travel(rig, 0.5)]) as execution:
        rig.until(lambda: execution.done, "the trajectory ends")
    rig.rest()
    with rig.recording() as recording:
        rig.let(0.4)
    assert np.ptp(recording.position, 0).max() <= SETTLED_RAD
    assert np.ptp(recording.position_command, 0).max() <= SETTLED_RAD


def test_a_canceled_trajectory_stops_within_the_limits(jointed: Rig) -> None:
    rig = jointed

    def motion() -> Recording:
        with rig.recording() as recording, rig.following([1.2], [joint_travel(rig)]) as execution:
            rig.let(0.6)
            execution.cancel()
            rig.until(lambda: execution.done, "the trajectory is stopped")
        assert execution.outcome is Outcome.CANCELED
        rig.rest()
        return recording

    check_smooth(rig, motion)


def test_a_new_goal_takes_over_without_a_jump(jointed: Rig) -> None:
    rig = jointed

    def motion() -> Recording:
        way = joint_travel(rig)
        with rig.recording() as recording, rig.following([1.2], [way]) as first:
            rig.let(0.5)
            with rig.following([1.0], [-0.3 * way]) as second:
                rig.until(lambda: second.done, "the second trajectory ends")
        assert first.outcome is Outcome.PREEMPTED
        assert second.outcome is Outcome.SUCCEEDED, second.message
        return recording

    check_smooth(rig, motion)


def test_no_joint_leaps_after_the_cycle_has_stood(jointed: Rig) -> None:
    """``AxisDriver.goes_on`` says where a joint is by then."""
    rig, joints = jointed, list(jointed.robot.joint_axes)
    periods = count()

    def stand_once(image: ProcessImage) -> None:
        if next(periods) == round(STANDS_AFTER_S / rig.period_s):
            rig.robot.cycle.delay(STANDS_S)

    with (
        rig.recording() as recording,
        rig.following([1.2], [joint_travel(rig)]) as execution,
        rig.each_period(stand_once),
    ):
        rig.until(lambda: execution.done, "the trajectory ends")
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert np.diff(recording.time_s).max() > STANDS_S / 2
    times_s = np.linspace(0.0, execution.trajectory.duration_s, 100)
    path = np.abs(execution.trajectory.evaluate(times_s)[1]).max(0)
    _, speeds = recording.slope(recording.position, 2 * rig.period_s)
    fastest = np.abs(speeds[:, joints]).max(0)
    for name, speed, meant in zip(rig.robot.joint_names, fastest, path, strict=True):
        assert speed <= LEAP * meant, f"{name}: {speed:.3g} rad/s on a path of {meant:.3g}"


def test_trajectories_may_follow_at_once_on_each_other(jointed: Rig) -> None:
    rig, way = jointed, joint_travel(jointed, 0.3)
    for sign in (1.0, -1.0, 1.0):
        with rig.following([0.5], [sign * way]) as execution:
            rig.until(lambda: execution.done, "the trajectory ends")
        assert execution.outcome is Outcome.SUCCEEDED, execution.message


def test_an_axis_takes_moves_after_a_trajectory(jointed: Rig) -> None:
    rig = jointed
    with rig.following([0.5], [joint_travel(rig, 0.3)]) as execution:
        rig.until(lambda: execution.done, "the trajectory ends")
    rig.rest()
    targets = rig.image.position_command - rig.travel(0.3)
    rig.move(rig.all, targets)
    rig.rest()
    assert rig.image.position == pytest.approx(targets, abs=SETTLED_RAD)
