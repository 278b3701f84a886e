"""Goals that are planned anew while the joints move."""

from __future__ import annotations

import numpy as np
import pytest
from tests.core.control.harness import ACCELERATION, FAR, HOME, PERIOD_S, Harness, arm, peak

from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.motion import TrajectoryRejected, TrajectoryRequest


def replan(harness: Harness, execution: TrajectoryExecution, age_s: float) -> TrajectoryRequest:
    """Return points that start at the joint positions of ``age_s`` ago, at rest."""
    progress = execution.progress()
    was = execution.trajectory.state_at(progress.time_s - age_s).position
    times_s = np.arange(0.0, 2.01, 0.02)
    share = (times_s / times_s[-1])[:, None]
    displacement = np.array([0.2, -0.4, 0.1]) - was
    positions = was + displacement * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    return TrajectoryRequest(harness.robot.joint_names, times_s, positions)


@pytest.mark.parametrize("age_s", [0.0, 0.05, 0.2])
@pytest.mark.parametrize("seconds", [1.5, 5.0])
def test_replanning_in_motion_with_a_first_point_at_time_zero(
    harness: Harness, seconds: float, age_s: float
) -> None:
    with harness.goal(FAR, seconds=seconds) as first:
        harness.run(0.4 * seconds)
        with harness.follower.follow(replan(harness, first, age_s)) as second:
            harness.end(second)
            assert harness.image.position == pytest.approx([0.2, -0.4, 0.1], abs=1e-3)
    assert (first.outcome, second.outcome) == (Outcome.PREEMPTED, Outcome.SUCCEEDED)
    harness.setpoints.assert_smooth(min(ACCELERATION, peak(first, second)))


def test_replanning_from_positions_that_are_too_old_is_rejected(harness: Harness) -> None:
    with harness.goal(FAR, seconds=1.5) as first:
        harness.run(0.9)
        with (
            pytest.raises(TrajectoryRejected, match="away from the recent path"),
            harness.follower.follow(replan(harness, first, 0.7)),
        ):
            pass
        harness.end(first)
    assert first.outcome is Outcome.SUCCEEDED
    harness.setpoints.assert_smooth(peak(first))


def test_replanning_while_a_cancel_slows_the_joints_down(harness: Harness) -> None:
    with harness.goal(FAR, seconds=1.5) as first:
        harness.run(0.6)
        request = replan(harness, first, 0.1)
        first.cancel()
        harness.run(2 * PERIOD_S)
        with harness.follower.follow(request) as second:
            assert first.outcome is Outcome.CANCELED
            harness.end(second)
    assert second.outcome is Outcome.SUCCEEDED, second.message
    harness.setpoints.assert_smooth_streams(max(ACCELERATION, peak(second)))


def test_replanning_soon_after_a_takeover(harness: Harness) -> None:
    """Joint positions of the third goal are from before the second one took over."""
    with harness.goal(FAR, seconds=1.5) as first:
        harness.run(0.6)
        with harness.follower.follow(replan(harness, first, 0.0)) as second:
            request = replan(harness, first, 0.02)
            harness.run(0.1)
            with harness.follower.follow(request) as third:
                harness.end(third)
    assert second.outcome is Outcome.PREEMPTED
    assert third.outcome is Outcome.SUCCEEDED, third.message
    harness.setpoints.assert_smooth(max(ACCELERATION, peak(first, second, third)))


def test_the_end_of_an_earlier_goal_is_not_accepted_as_start(harness: Harness) -> None:
    """Other commands have moved the joints since."""
    with harness.goal(FAR) as execution:
        harness.end(execution)
    harness.move(0, 0.2)
    harness.run(3.0)
    request = TrajectoryRequest.from_rows(harness.robot.joint_names, [0.0, 1.0], [FAR, HOME])
    with (
        pytest.raises(TrajectoryRejected, match="away from the present position"),
        harness.follower.follow(request),
    ):
        pass


def test_joints_without_a_usual_velocity_limit_are_replanned() -> None:
    """The recent path has as many points as the limit asks for, but no more than fit."""
    joints = [joint.model_copy(update={"velocity_rad_s": 1e8}) for joint in arm().joints]
    harness = Harness(arm().model_copy(update={"joints": joints})).up()
    with harness.goal(FAR, seconds=1.5) as first:
        harness.run(0.6)
        with harness.follower.follow(replan(harness, first, 0.1)) as second:
            harness.end(second)
    harness.robot.shutdown()
    assert second.outcome is Outcome.SUCCEEDED, second.message
