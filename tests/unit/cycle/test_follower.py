"""Goals from their start to their end: what reaches the drives, and what the client is told."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.unit.cycle.rig import ACCELERATION, PERIOD_S, Rig

from robotd.cycle.execution import Execution, Outcome
from robotd.cycle.streamer import PREEMPTED, SPLICE_LOST
from robotd.device.state import Operation
from robotd.errors import NotReady
from robotd.motion import JointTolerance, TrajectoryRefused, TrajectoryRequest

HOME = (0.0, 0.0, 0.0)
FAR = (1.0, -0.6, 0.3)
CANCELED = "canceled by the client"


@pytest.fixture
def rig() -> Rig:
    return Rig().up()


def peak(*executions: Execution) -> float:
    """The highest acceleration that was planned."""
    return max(float(each.trajectory.peaks.acceleration.value.max()) for each in executions)


def at(rig: Rig, seconds: float) -> int:
    """Index of the setpoint that is due at the monotonic time ``seconds``."""
    return int(np.argmin(np.abs(rig.setpoints.due_s - seconds)))


def test_a_goal_ends_at_its_target_and_time(rig: Rig) -> None:
    with rig.goal(FAR) as execution:
        rig.end(execution)
        assert rig.image.position == pytest.approx(FAR, abs=1e-3)
    assert execution.outcome is Outcome.SUCCEEDED
    assert execution.message.startswith("goal reached after 1.000 s; largest following error 0.00")
    assert rig.now_s - execution.start_ns * 1e-9 == pytest.approx(1.0, abs=0.02)
    rig.setpoints.assert_smooth(peak(execution))


def test_the_setpoints_are_the_trajectory_from_its_start_on(rig: Rig) -> None:
    with rig.goal(FAR, HOME, FAR) as execution:
        rig.end(execution)
    setpoints = rig.setpoints
    times_s = setpoints.due_s - execution.start_ns * 1e-9
    position, velocity, _ = execution.trajectory.evaluate(times_s)
    assert times_s[0] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(setpoints.position, position, atol=1e-9)
    np.testing.assert_allclose(setpoints.velocity[1:-1], velocity[1:-1], atol=1e-7)


@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), order=st.permutations(range(3)))
def test_twenty_points_in_any_order_of_joints(seed: int, order: list[int]) -> None:
    random, rig = np.random.default_rng(seed), Rig().up()
    times_s = np.cumsum(random.uniform(0.15, 0.3, 20))
    points = np.cumsum(random.uniform(-0.1, 0.1, (20, 3)), axis=0)
    names = tuple(rig.robot.joint_names[joint] for joint in order)
    with rig.follower.follow(TrajectoryRequest(names, times_s, points[:, order])) as execution:
        rig.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert rig.image.position == pytest.approx(points[-1], abs=1e-3)
    ended = at(rig, execution.start_ns * 1e-9 + times_s[-1] + PERIOD_S)
    assert rig.setpoints.position[ended] == pytest.approx(points[-1], abs=1e-9)
    rig.setpoints.assert_smooth(peak(execution))
    fastest = execution.trajectory.peaks.velocity.value
    steps = np.abs(np.diff(rig.setpoints.position, axis=0)).max(axis=0)
    assert (steps <= fastest * PERIOD_S * 1.001 + 1e-9).all()
    rig.robot.shutdown()


def test_a_newer_goal_takes_over_without_a_jump(rig: Rig) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.4)
        with rig.goal((-0.5, 0.5, -0.2), seconds=1.5) as second:
            assert not first.done
            rig.end(second)
    assert (first.outcome, first.message) == (Outcome.PREEMPTED, PREEMPTED)
    assert second.outcome is Outcome.SUCCEEDED
    rig.setpoints.assert_smooth(peak(first, second))
    moment = second.start_ns * 1e-9
    before, after = at(rig, moment - PERIOD_S), at(rig, moment + PERIOD_S)
    assert (np.abs(rig.setpoints.velocity[[before, after]]) > 0.2).any(axis=1).all()
    assert second.max_error.max() < 5e-3


def test_the_path_tolerance_of_a_goal_that_takes_over_holds_from_its_first_period(
    rig: Rig,
) -> None:
    tolerances = rig.follower.tolerances(path=[JointTolerance("joint1", position=2e-3)])
    with rig.goal(FAR, seconds=0.5):
        rig.run(0.25)
        with rig.goal(FAR, seconds=0.5, tolerances=tolerances) as second:
            rig.end(second)
    assert second.outcome is Outcome.SUCCEEDED, second.message


def test_a_goal_replaces_one_that_waits_to_take_over(rig: Rig) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.3)
        with rig.goal((0.2, 0.2, 0.2), start_in_s=0.5) as waiting:
            rig.run(0.1)
            with rig.goal(HOME, seconds=1.5) as last:
                assert (waiting.outcome, waiting.message) == (Outcome.PREEMPTED, PREEMPTED)
                assert not first.done
                rig.end(last)
    assert first.outcome is Outcome.PREEMPTED
    assert last.outcome is Outcome.SUCCEEDED
    rig.setpoints.assert_smooth(peak(first, last))


def test_goals_in_quick_succession_never_jump(rig: Rig) -> None:
    random, ended = np.random.default_rng(7), []
    for _ in range(30):
        with rig.goal(random.uniform(-0.3, 0.3, 3), seconds=1.0) as execution:
            ended.append(execution)
            rig.run(random.choice([0.0, PERIOD_S, 0.01, 0.05]))
            with rig.goal(random.uniform(-0.3, 0.3, 3), seconds=1.2) as newer:
                ended.append(newer)
                rig.run(random.choice([0.0, PERIOD_S, 0.03, 0.2]))
    assert all(each.outcome is not None for each in ended)
    rig.setpoints.assert_smooth_streams(max(peak(*ended), ACCELERATION))


def test_a_goal_waits_for_its_time_and_holds_still_until_then(rig: Rig) -> None:
    asked_s = rig.now_s + 0.5
    with rig.goal(FAR, start_in_s=0.5) as execution:
        rig.run(0.48)
        assert execution.progress().time_s < 0
        assert np.abs(rig.setpoints.position).max() < 1e-9
        rig.end(execution)
    assert execution.start_ns * 1e-9 == pytest.approx(asked_s)
    assert execution.outcome is Outcome.SUCCEEDED
    rig.setpoints.assert_smooth(peak(execution))


def test_a_goal_whose_time_has_not_come_can_be_canceled(rig: Rig) -> None:
    with rig.goal(FAR, start_in_s=5.0) as execution:
        rig.run(0.1)
        execution.cancel()
        rig.run(0.1)
        assert (execution.outcome, execution.message) == (Outcome.CANCELED, CANCELED)
    assert rig.image.position == pytest.approx(HOME, abs=1e-4)


def test_one_that_waits_to_take_over_can_be_canceled_and_the_other_goes_on(rig: Rig) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.2)
        with rig.goal(HOME, start_in_s=0.5) as waiting:
            rig.run(0.1)
            waiting.cancel()
            rig.run(2 * PERIOD_S)
            assert waiting.outcome is Outcome.CANCELED
        rig.end(first)
    assert first.outcome is Outcome.SUCCEEDED
    rig.setpoints.assert_smooth(peak(first))


def test_one_that_waits_falls_with_the_path_it_was_planned_on(rig: Rig) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.4)
        with rig.goal(HOME, start_in_s=3.0) as waiting:
            first.cancel()
            rig.end(first)
            rig.run(5.0)
    assert first.outcome is Outcome.CANCELED
    assert (waiting.outcome, waiting.message) == (Outcome.FAULT, SPLICE_LOST)
    rig.setpoints.assert_smooth(ACCELERATION)


def test_one_that_waits_begins_in_time_after_the_other_has_succeeded(rig: Rig) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.5)
        with rig.goal(HOME, start_in_s=2.0) as waiting:
            rig.end(first)
            rig.run(0.2)
            assert not waiting.done
            rig.end(waiting)
    assert (first.outcome, waiting.outcome) == (Outcome.SUCCEEDED, Outcome.SUCCEEDED)
    rig.setpoints.assert_smooth(peak(first, waiting))


@pytest.mark.parametrize("moment_s", [0.0, PERIOD_S, 0.05, 0.3, 0.5, 0.9, 0.998])
def test_cancel_slows_down_along_the_path_within_the_limits(rig: Rig, moment_s: float) -> None:
    with rig.goal(FAR) as execution:
        rig.run(moment_s)
        execution.cancel()
        rig.end(execution)
        assert np.abs(rig.image.velocity).max() < 0.01
    assert (execution.outcome, execution.message) == (Outcome.CANCELED, CANCELED)
    rig.setpoints.assert_smooth(max(ACCELERATION, peak(execution)))
    position = rig.setpoints.position
    along = position @ np.array(FAR) / np.dot(FAR, FAR)
    assert np.abs(position - along[:, None] * FAR).max() < 1e-9
    assert (np.diff(along) >= -1e-12).all()
    assert rig.image.position == pytest.approx(position[-1], abs=1e-3)


def test_cancel_while_arriving_ends_where_the_path_ends(rig: Rig) -> None:
    tolerances = rig.follower.tolerances(goal=[JointTolerance("joint1", position=1e-9)])
    with rig.goal(FAR, tolerances=tolerances) as execution:
        rig.run(1.1)
        assert not execution.done
        execution.cancel()
        rig.end(execution)
    assert execution.outcome is Outcome.CANCELED
    assert rig.image.position == pytest.approx(FAR, abs=1e-3)


def test_a_late_cancel_changes_nothing(rig: Rig) -> None:
    with rig.goal(FAR) as execution:
        rig.end(execution)
        execution.cancel()
        assert execution.ending is None
    assert execution.outcome is Outcome.SUCCEEDED


def test_a_goal_during_a_stop_waits_for_standstill(rig: Rig) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.4)
        first.cancel()
        rig.run(PERIOD_S)
        with rig.goal(HOME) as second:
            assert first.outcome is Outcome.CANCELED
            rig.end(second)
    assert second.outcome is Outcome.SUCCEEDED
    rig.setpoints.assert_smooth_streams(max(ACCELERATION, peak(second)))
    assert rig.image.position == pytest.approx(HOME, abs=1e-3)


def test_a_refused_goal_leaves_what_runs_alone(rig: Rig) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.3)
        with pytest.raises(TrajectoryRefused, match="joint1"), rig.goal((9.0, 0, 0)):
            pass
        rig.end(first)
    assert first.outcome is Outcome.SUCCEEDED
    rig.setpoints.assert_smooth(peak(first))


def test_a_refused_goal_at_rest_touches_no_axis(rig: Rig) -> None:
    with pytest.raises(TrajectoryRefused), rig.goal((9.0, 0, 0)):
        pass
    assert not rig.axes_in(Operation.STREAM)
    assert rig.setpoints.rows == []


def test_a_goal_is_refused_while_somebody_else_has_the_axes(rig: Rig) -> None:
    text = "joint1 is in use by somebody else"
    claim = rig.robot.axes.claimed("somebody else", [0, 1, 2])
    with claim, pytest.raises(NotReady, match=text), rig.goal(FAR):
        pass


def test_a_goal_is_refused_while_the_axis_moves_otherwise(rig: Rig) -> None:
    rig.move(1, 0.5)
    text = "joint2: follow_joint_trajectory needs an idle axis, this one is in position"
    with pytest.raises(NotReady, match=text), rig.goal(FAR):
        pass
    assert not rig.axes_in(Operation.STREAM)


def test_the_axes_are_free_again_after_the_block(rig: Rig) -> None:
    with rig.goal(FAR) as execution:
        with pytest.raises(NotReady, match="joint1 is in use by follow_joint_trajectory"):
            rig.move(0, 0.0)
        rig.end(execution)
    assert not rig.axes_in(Operation.STREAM)
    rig.move(0, 0.0)


def test_leaving_the_block_stops_what_runs(rig: Rig) -> None:
    with rig.goal(FAR) as execution:
        rig.run(0.3)
    assert execution.outcome is Outcome.CANCELED
    rig.setpoints.assert_smooth(ACCELERATION)


def test_stop_ends_what_runs_and_what_waits(rig: Rig) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.3)
        with rig.goal(HOME, start_in_s=1.0) as waiting:
            rig.follower.stop()
            assert [first.outcome, waiting.outcome] == [Outcome.CANCELED] * 2
    rig.follower.stop()  # nothing runs


def test_a_path_tolerance_names_joint_time_value_and_limit(rig: Rig) -> None:
    tolerances = rig.follower.tolerances(path=[JointTolerance("joint2", position=1e-5)])
    with rig.goal(FAR, tolerances=tolerances) as execution:
        rig.end(execution)
    assert execution.outcome is Outcome.PATH_TOLERANCE
    assert execution.message.startswith("joint2 at 0.")
    assert "position error" in execution.message
    assert execution.message.endswith("exceeds path tolerance 1e-05 rad")
    rig.setpoints.assert_smooth(ACCELERATION)


def test_a_goal_tolerance_is_waited_for_no_longer_than_asked(rig: Rig) -> None:
    tolerances = rig.follower.tolerances(
        goal=[JointTolerance("joint3", position=1e-9)], goal_time_s=0.3
    )
    with rig.goal(FAR, tolerances=tolerances) as execution:
        rig.end(execution)
    assert execution.outcome is Outcome.GOAL_TOLERANCE
    assert execution.message.startswith("joint3 at 1.3")
    assert execution.message.endswith("exceeds goal tolerance 1e-09 rad")


def test_progress_tells_where_it_is(rig: Rig) -> None:
    with rig.goal(FAR) as execution:
        rig.run(0.5)
        progress = execution.progress()
    assert progress.time_s == pytest.approx(0.5, abs=0.01)
    assert progress.desired_position == pytest.approx(progress.actual_position, abs=1e-2)
    assert progress.desired_velocity == pytest.approx(progress.actual_velocity, abs=0.1)
