"""Goals from start to end: setpoints at the drives and outcomes for the client."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.core.control.harness import ACCELERATION, FAR, HOME, PERIOD_S, Harness, peak
from tests.core.motion.helpers import peaks_of

from robotd.control.groups.trajectory_follower import check_start_time
from robotd.control.loop.setpoint_mixer import SPLICE_LOST
from robotd.control.loop.setpoint_source import PREEMPTED, Outcome
from robotd.control.sources.streamed_trajectory import StreamedTrajectory
from robotd.device.state import Operation
from robotd.errors import NotReady
from robotd.events import EventKind
from robotd.motion import JointTolerance, RejectionCode, TrajectoryRejected, TrajectoryRequest

CANCELED = "canceled by the client"


def at(harness: Harness, seconds: float) -> int:
    """Return the index of the setpoint that is due at the monotonic time ``seconds``."""
    return int(np.argmin(np.abs(harness.setpoints.due_s - seconds)))


def test_a_goal_ends_at_its_target_and_time(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.end(execution)
        assert harness.image.position == pytest.approx(FAR, abs=1e-3)
    assert execution.outcome is Outcome.SUCCEEDED
    assert execution.message.startswith("goal reached after 1.000 s; largest following error 0.00")
    assert harness.now_s - execution.start_ns * 1e-9 == pytest.approx(1.0, abs=0.02)
    harness.setpoints.assert_smooth(peak(execution))


def test_the_setpoints_are_the_trajectory_from_its_start_on(harness: Harness) -> None:
    with harness.goal(FAR, HOME, FAR) as execution:
        harness.end(execution)
    setpoints = harness.setpoints
    times_s = setpoints.due_s - execution.start_ns * 1e-9
    position, velocity, _ = execution.trajectory.evaluate(times_s)
    assert times_s[0] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(setpoints.position, position, atol=1e-9)
    np.testing.assert_allclose(setpoints.velocity[1:-1], velocity[1:-1], atol=1e-7)


@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), order=st.permutations(range(3)))
def test_twenty_points_in_any_order_of_joints(seed: int, order: list[int]) -> None:
    random, harness = np.random.default_rng(seed), Harness().up()
    times_s = np.cumsum(random.uniform(0.15, 0.3, 20))
    points = np.cumsum(random.uniform(-0.1, 0.1, (20, 3)), axis=0)
    names = tuple(harness.robot.joint_names[joint] for joint in order)
    with harness.follower.follow(TrajectoryRequest(names, times_s, points[:, order])) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert harness.image.position == pytest.approx(points[-1], abs=1e-3)
    ended = at(harness, execution.start_ns * 1e-9 + times_s[-1] + PERIOD_S)
    assert harness.setpoints.position[ended] == pytest.approx(points[-1], abs=1e-9)
    harness.setpoints.assert_smooth(peak(execution))
    fastest = peaks_of(execution.trajectory).velocity.value
    steps = np.abs(np.diff(harness.setpoints.position, axis=0)).max(axis=0)
    assert (steps <= fastest * PERIOD_S * 1.001 + 1e-9).all()
    harness.robot.shutdown()


def test_a_newer_goal_takes_over_without_a_jump(harness: Harness) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.4)
        with harness.goal((-0.5, 0.5, -0.2), seconds=1.5) as second:
            assert not first.done
            harness.end(second)
    assert (first.outcome, first.message) == (Outcome.PREEMPTED, PREEMPTED)
    assert second.outcome is Outcome.SUCCEEDED
    harness.setpoints.assert_smooth(peak(first, second))
    moment = second.start_ns * 1e-9
    before, after = at(harness, moment - PERIOD_S), at(harness, moment + PERIOD_S)
    assert (np.abs(harness.setpoints.velocity[[before, after]]) > 0.2).any(axis=1).all()
    assert second.max_error.max() < 5e-3


def test_the_path_tolerance_of_a_goal_that_takes_over_holds_from_its_first_period(
    harness: Harness,
) -> None:
    tolerances = harness.follower.tolerances(path=[JointTolerance("joint1", position=2e-3)])
    with harness.goal(FAR, seconds=0.5):
        harness.run(0.25)
        with harness.goal(FAR, seconds=0.5, tolerances=tolerances) as second:
            harness.end(second)
    assert second.outcome is Outcome.SUCCEEDED, second.message


def test_a_goal_replaces_one_that_waits_to_take_over(harness: Harness) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.3)
        with harness.goal((0.2, 0.2, 0.2), start_in_s=0.5) as waiting:
            harness.run(0.1)
            with harness.goal(HOME, seconds=1.5) as last:
                assert (waiting.outcome, waiting.message) == (Outcome.PREEMPTED, PREEMPTED)
                assert not first.done
                harness.end(last)
    assert first.outcome is Outcome.PREEMPTED
    assert last.outcome is Outcome.SUCCEEDED
    harness.setpoints.assert_smooth(peak(first, last))


def test_goals_in_quick_succession_never_jump(harness: Harness) -> None:
    random, ended = np.random.default_rng(7), []
    for _ in range(30):
        with harness.goal(random.uniform(-0.3, 0.3, 3), seconds=1.0) as execution:
            ended.append(execution)
            harness.run(random.choice([0.0, PERIOD_S, 0.01, 0.05]))
            with harness.goal(random.uniform(-0.3, 0.3, 3), seconds=1.2) as newer:
                ended.append(newer)
                harness.run(random.choice([0.0, PERIOD_S, 0.03, 0.2]))
    assert all(execution.outcome is not None for execution in ended)
    harness.setpoints.assert_smooth_streams(max(peak(*ended), ACCELERATION))


def test_a_goal_waits_for_its_time_and_holds_still_until_then(harness: Harness) -> None:
    asked_s = harness.now_s + 0.5
    with harness.goal(FAR, start_in_s=0.5) as execution:
        harness.run(0.48)
        assert execution.progress().time_s < 0
        assert np.abs(harness.setpoints.position).max() < 1e-9
        harness.end(execution)
    assert execution.start_ns * 1e-9 == pytest.approx(asked_s)
    assert execution.outcome is Outcome.SUCCEEDED
    harness.setpoints.assert_smooth(peak(execution))


def test_a_goal_whose_time_has_not_come_can_be_canceled(harness: Harness) -> None:
    with harness.goal(FAR, start_in_s=5.0) as execution:
        harness.run(0.1)
        execution.cancel()
        harness.run(0.1)
        assert (execution.outcome, execution.message) == (Outcome.CANCELED, CANCELED)
    assert harness.image.position == pytest.approx(HOME, abs=1e-4)


def test_a_waiting_goal_can_be_canceled_and_the_running_one_continues(
    harness: Harness,
) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.2)
        with harness.goal(HOME, start_in_s=0.5) as waiting:
            harness.run(0.1)
            waiting.cancel()
            harness.run(2 * PERIOD_S)
            assert waiting.outcome is Outcome.CANCELED
        harness.end(first)
    assert first.outcome is Outcome.SUCCEEDED
    harness.setpoints.assert_smooth(peak(first))


def test_a_waiting_goal_fails_with_the_path_it_was_planned_on(harness: Harness) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.4)
        with harness.goal(HOME, start_in_s=3.0) as waiting:
            first.cancel()
            harness.end(first)
            harness.run(5.0)
    assert first.outcome is Outcome.CANCELED
    assert (waiting.outcome, waiting.message) == (Outcome.FAULT, SPLICE_LOST)
    harness.setpoints.assert_smooth(ACCELERATION)


def test_a_waiting_goal_begins_in_time_after_the_other_has_succeeded(harness: Harness) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.5)
        with harness.goal(HOME, start_in_s=2.0) as waiting:
            harness.end(first)
            harness.run(0.2)
            assert not waiting.done
            harness.end(waiting)
    assert (first.outcome, waiting.outcome) == (Outcome.SUCCEEDED, Outcome.SUCCEEDED)
    harness.setpoints.assert_smooth(peak(first, waiting))


@pytest.mark.parametrize("moment_s", [0.0, PERIOD_S, 0.05, 0.3, 0.5, 0.9, 0.998])
def test_cancel_slows_down_along_the_path_within_the_limits(
    harness: Harness, moment_s: float
) -> None:
    with harness.goal(FAR) as execution:
        harness.run(moment_s)
        execution.cancel()
        harness.end(execution)
        assert np.abs(harness.image.velocity).max() < 0.01
    assert (execution.outcome, execution.message) == (Outcome.CANCELED, CANCELED)
    harness.setpoints.assert_smooth(max(ACCELERATION, peak(execution)))
    position = harness.setpoints.position
    along = position @ np.array(FAR) / np.dot(FAR, FAR)
    assert np.abs(position - along[:, None] * FAR).max() < 1e-9
    assert (np.diff(along) >= -1e-12).all()
    assert harness.image.position == pytest.approx(position[-1], abs=1e-3)


def test_cancel_while_arriving_ends_where_the_path_ends(harness: Harness) -> None:
    tolerances = harness.follower.tolerances(goal=[JointTolerance("joint1", position=1e-9)])
    with harness.goal(FAR, tolerances=tolerances) as execution:
        harness.run(1.1)
        assert not execution.done
        execution.cancel()
        harness.end(execution)
    assert execution.outcome is Outcome.CANCELED
    assert harness.image.position == pytest.approx(FAR, abs=1e-3)


def test_a_late_cancel_changes_nothing(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.end(execution)
        execution.cancel()
        assert execution.completion.requested is None
    assert execution.outcome is Outcome.SUCCEEDED


def test_a_goal_during_a_stop_waits_for_standstill(harness: Harness) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.4)
        first.cancel()
        harness.run(PERIOD_S)
        with harness.goal(HOME) as second:
            assert first.outcome is Outcome.CANCELED
            harness.end(second)
    assert second.outcome is Outcome.SUCCEEDED
    harness.setpoints.assert_smooth_streams(max(ACCELERATION, peak(second)))
    assert harness.image.position == pytest.approx(HOME, abs=1e-3)


def test_a_rejected_goal_leaves_the_running_one_alone(harness: Harness) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.3)
        with pytest.raises(TrajectoryRejected, match="joint1"), harness.goal((9.0, 0, 0)):
            pass
        harness.end(first)
    assert first.outcome is Outcome.SUCCEEDED
    harness.setpoints.assert_smooth(peak(first))


def test_a_goal_that_is_over_already_is_rejected_and_noted(harness: Harness) -> None:
    goal = harness.goal(FAR, start_in_s=-2.0)
    with pytest.raises(TrajectoryRejected, match="it is over"), goal:
        pass
    events = harness.robot.events.since(0)[0]
    assert [event.kind for event in events if "it is over" in event.text] == [EventKind.GOAL]


def test_a_rejected_goal_at_rest_claims_no_axis(harness: Harness) -> None:
    with pytest.raises(TrajectoryRejected), harness.goal((9.0, 0, 0)):
        pass
    assert not harness.axes_in(Operation.STREAM)
    assert harness.setpoints.rows == []


def test_a_goal_is_rejected_while_the_axes_are_claimed(harness: Harness) -> None:
    text = "joint1: in use by somebody else"
    claim = harness.robot.axes.claimed("somebody else", [0, 1, 2])
    with claim, pytest.raises(NotReady, match=text), harness.goal(FAR):
        pass


def test_a_goal_is_rejected_while_an_axis_moves(harness: Harness) -> None:
    harness.move(1, 0.5)
    text = "joint2: trajectory needs an idle axis, this one is in position"
    with pytest.raises(NotReady, match=text), harness.goal(FAR):
        pass
    assert not harness.axes_in(Operation.STREAM)


def test_the_axes_are_free_again_after_the_block(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        with pytest.raises(NotReady, match="joint1: in use by trajectory"):
            harness.move(0, 0.0)
        harness.end(execution)
    assert not harness.axes_in(Operation.STREAM)
    harness.move(0, 0.0)


def test_leaving_the_block_stops_the_goal(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.3)
    assert execution.outcome is Outcome.CANCELED
    harness.setpoints.assert_smooth(ACCELERATION)


def test_stop_ends_the_running_and_the_waiting_goal(harness: Harness) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.3)
        with harness.goal(HOME, start_in_s=1.0) as waiting:
            harness.robot.groups.stop()
            assert [first.outcome, waiting.outcome] == [Outcome.CANCELED] * 2
    harness.robot.groups.stop()  # nothing runs


def test_a_path_tolerance_names_joint_time_value_and_limit(harness: Harness) -> None:
    tolerances = harness.follower.tolerances(path=[JointTolerance("joint2", position=1e-5)])
    with harness.goal(FAR, tolerances=tolerances) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.PATH_TOLERANCE
    assert execution.message.startswith("joint2 at 0.")
    assert "position error" in execution.message
    assert execution.message.endswith("exceeds path tolerance 1e-05 rad")
    harness.setpoints.assert_smooth(ACCELERATION)


def test_a_goal_tolerance_is_waited_for_no_longer_than_asked(harness: Harness) -> None:
    tolerances = harness.follower.tolerances(
        goal=[JointTolerance("joint3", position=1e-9)], goal_time_s=0.3
    )
    with harness.goal(FAR, tolerances=tolerances) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.GOAL_TOLERANCE
    assert execution.message.startswith("joint3 at 1.3")
    assert execution.message.endswith("exceeds goal tolerance 1e-09 rad")


def test_progress_has_time_and_positions(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.5)
        progress = execution.progress()
    assert progress.time_s == pytest.approx(0.5, abs=0.01)
    assert progress.desired_position == pytest.approx(progress.actual_position, abs=1e-2)
    assert progress.desired_velocity == pytest.approx(progress.actual_velocity, abs=0.1)


def test_a_goal_of_some_joints_leaves_the_others_where_they_are(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.end(execution)
    request = TrajectoryRequest.from_rows(["joint3", "joint1"], [1.0], [[0.0, 0.5]])
    with harness.follower.follow(request) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert harness.image.position == pytest.approx([0.5, FAR[1], 0.0], abs=1e-3)


def test_a_goal_of_some_joints_needs_the_others_at_rest(harness: Harness) -> None:
    request = TrajectoryRequest.from_rows(["joint1"], [1.0], [[0.5]])
    with harness.goal(FAR) as execution:
        harness.run(0.3)
        with (
            pytest.raises(TrajectoryRejected, match="missing joint joint2: it moves with -0"),
            harness.follower.follow(request),
        ):
            pass
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED


def test_the_joints_hold_until_a_first_point_at_their_position(harness: Harness) -> None:
    request = TrajectoryRequest.from_rows(harness.robot.joint_names, [0.5, 1.0], [HOME, FAR])
    with harness.follower.follow(request) as execution:
        harness.run(0.49)
        assert np.abs(harness.setpoints.position).max() < 1e-9
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED
    assert harness.image.position == pytest.approx(FAR, abs=1e-3)


def test_a_joint_that_is_held_ends_the_goal_and_does_not_leap_when_it_is_free(
    harness: Harness,
) -> None:
    harness.faults.block(0, True)
    start_s = harness.now_s
    with harness.goal(FAR) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.PATH_TOLERANCE
    assert "exceeds path tolerance 0.2 rad" in execution.message
    assert harness.now_s - start_s < 2.0, "reported while the joint was still commanded to move"
    harness.setpoints.assert_smooth(ACCELERATION)
    harness.run(0.1)
    assert harness.image.position_command[0] == pytest.approx(harness.image.position[0], abs=1e-3)
    assert harness.image.servo_on.all()
    held_at = harness.image.position.copy()
    harness.faults.block(0, False)
    speeds: list[float] = []
    harness.robot.control_loop.every(
        500.0, "speed", lambda image: speeds.append(float(abs(image.velocity[0])))
    )
    harness.run(1.0)
    assert max(speeds) < 0.05
    assert harness.image.position == pytest.approx(held_at, abs=5e-3)


def test_a_joint_that_is_freed_while_the_command_returns_makes_no_jump(harness: Harness) -> None:
    harness.faults.block(0, True)
    with harness.goal(FAR) as execution:
        while execution.completion.requested is None or harness.setpoints.velocity[-1, 0] > -0.05:
            harness.run(PERIOD_S)
        harness.faults.block(0, False)
        harness.end(execution)
    assert execution.outcome is Outcome.PATH_TOLERANCE
    harness.setpoints.assert_smooth(ACCELERATION)


def test_default_tolerances_count_from_the_next_goal_on(harness: Harness) -> None:
    harness.up()
    joints = len(harness.robot.joint_names)
    with harness.goal((0.5, 0.0, 0.0)) as execution:
        harness.run(0.2)
        harness.follower.set_default_tolerances([1e-9] * joints, [1e-9] * joints, 0.5)
        assert harness.end(execution).outcome is Outcome.SUCCEEDED
    with harness.goal((0.0, 0.0, 0.0)) as execution:
        assert harness.end(execution).outcome is Outcome.PATH_TOLERANCE
    unlimited = [np.inf] * joints
    harness.follower.set_default_tolerances(unlimited, unlimited, np.inf)
    with harness.goal((0.2, 0.0, 0.0)) as execution:
        assert harness.end(execution).outcome is Outcome.SUCCEEDED


def test_joints_are_free_after_a_goal_that_could_not_begin(
    harness: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No thread, for example: an error that is none of robotd's."""

    def begin(self: StreamedTrajectory) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(StreamedTrajectory, "begin", begin)
        with pytest.raises(RuntimeError, match="thread"), harness.goal(FAR):
            pass
    assert [harness.robot.axes.owner(axis) for axis in range(3)] == [""] * 3
    harness.run(0.5)
    assert harness.image.position == pytest.approx(HOME, abs=1e-3)
    with harness.goal(FAR) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED


def test_a_trajectory_that_is_over_is_rejected_as_such() -> None:
    check_start_time(-1.0, 2.0)
    check_start_time(0.0, 2.0)
    with pytest.raises(TrajectoryRejected) as rejected:
        check_start_time(-3.0, 2.0)
    assert rejected.value.code is RejectionCode.OLD_HEADER_TIMESTAMP
    assert str(rejected.value) == (
        "the trajectory of 2.000 s should have begun 3.000 s ago: it is over"
    )
