"""Changes while a goal is being planned: it must fit the running one when submitted."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from tests.core.control.harness import ACCELERATION, FAR, HOME, PERIOD_S, Harness, peak

from robotd.control.groups import joint_motion, trajectory_follower
from robotd.control.loop.setpoint_mixer import ABANDONED, NOT_RUNNING
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.streamed_trajectory import StreamedTrajectory
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.errors import NotReady
from robotd.motion import TrajectoryRequest

Meanwhile = Callable[[], Any]


@pytest.fixture
def while_planning(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[float]]:
    """``while_planning(first, second, ...)``: events during the next plannings."""
    plan = trajectory_follower.plan

    def install(*events: Meanwhile) -> list[float]:
        coming, starts = list(events), list[float]()

        def planned(request: Any, limits: Any, settings: Any, start: Any, *rest: Any) -> Any:
            starts.append(float(np.abs(start.velocity).max()))
            trajectory = plan(request, limits, settings, start, *rest)
            if coming:
                coming.pop(0)()
            return trajectory

        monkeypatch.setattr(trajectory_follower, "plan", planned)
        return starts

    return install


def test_planning_that_takes_longer_than_its_lead_is_done_again(
    harness: Harness, while_planning: Callable[..., list[float]]
) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.2)
        starts = while_planning(lambda: harness.run(0.05), lambda: harness.run(0.05))
        with harness.goal(HOME, seconds=1.5) as second:
            assert len(starts) == 2
            harness.end(second)
    assert (first.outcome, second.outcome) == (Outcome.PREEMPTED, Outcome.SUCCEEDED)
    harness.setpoints.assert_smooth(peak(first, second))


@pytest.mark.parametrize("later_s", [0.0, 0.0005, 0.0015])
@pytest.mark.parametrize("speed", [1.0, 0.5])
def test_a_cancel_in_the_first_period_after_a_takeover_makes_no_jump(
    harness: Harness, monkeypatch: pytest.MonkeyPatch, speed: float, later_s: float
) -> None:
    take_over = StreamedTrajectory.take_over

    def cancelled(self: StreamedTrajectory, *arguments: Any) -> None:
        take_over(self, *arguments)
        self.cancel()

    monkeypatch.setattr(StreamedTrajectory, "take_over", cancelled)
    harness.robot.axes.speed.set(speed)
    with harness.goal(FAR) as first:
        harness.run(0.5)
        with harness.goal(HOME, seconds=1.5, start_in_s=0.05 + later_s) as second:
            harness.end(second)
    assert (first.outcome, second.outcome) == (Outcome.PREEMPTED, Outcome.CANCELED)
    harness.setpoints.assert_smooth(1.05 * ACCELERATION)


def test_a_cancel_of_the_running_goal_makes_the_next_start_from_rest(
    harness: Harness, while_planning: Callable[..., list[float]]
) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.4)
        starts = while_planning(first.cancel)
        with harness.goal(HOME, seconds=1.5) as second:
            harness.end(second)
    assert (first.outcome, second.outcome) == (Outcome.CANCELED, Outcome.SUCCEEDED)
    assert starts[0] > 0.5
    assert starts[-1] == 0.0
    harness.setpoints.assert_smooth_streams(max(ACCELERATION, peak(second)))


def test_a_goal_that_took_over_meanwhile_is_the_predecessor(
    harness: Harness, while_planning: Callable[..., list[float]]
) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.3)
        with harness.goal((-0.3, 0.4, 0.5), seconds=1.5) as second:
            # Planned to follow the first one, in time, but the second one runs by then.
            starts = while_planning(lambda: harness.run(0.025))
            harness.run(2 * PERIOD_S)
            with harness.goal(HOME, seconds=1.5) as third:
                assert len(starts) == 2
                assert second.outcome is None
                harness.end(third)
    outcomes = [first.outcome, second.outcome, third.outcome]
    assert outcomes == [Outcome.PREEMPTED, Outcome.PREEMPTED, Outcome.SUCCEEDED]
    harness.setpoints.assert_smooth(peak(first, second, third))


def test_the_running_goal_may_end_meanwhile(
    harness: Harness, while_planning: Callable[..., list[float]]
) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.99)
        while_planning(lambda: harness.run(0.025))
        with harness.goal(HOME, start_in_s=0.3) as second:
            harness.end(second)
    assert (first.outcome, second.outcome) == (Outcome.SUCCEEDED, Outcome.SUCCEEDED)
    harness.setpoints.assert_smooth_streams(peak(first, second))


def test_a_waiting_goal_that_starts_meanwhile_is_not_skipped(
    harness: Harness, while_planning: Callable[..., list[float]]
) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.5)
        with harness.goal(HOME, seconds=1.5, start_in_s=0.7) as second:
            harness.until(lambda: harness.slot.running is first and first.done)
            # At rest now; while this one is planned the second one takes over and moves.
            while_planning(lambda: harness.run(0.6))
            with harness.goal((0.2, 0.2, 0.2), seconds=1.5) as third:
                assert second.outcome is None
                harness.end(third)
    assert second.outcome is Outcome.PREEMPTED
    assert third.outcome is Outcome.SUCCEEDED
    harness.setpoints.assert_smooth_streams(peak(first, second, third))


def test_axes_that_moved_meanwhile_cause_a_new_plan(
    harness: Harness, while_planning: Callable[..., list[float]]
) -> None:
    def move() -> None:
        harness.move(0, 0.1)
        harness.run(1.0)

    starts = while_planning(move)
    with harness.goal(FAR) as execution:
        harness.end(execution)
    assert len(starts) == 2
    assert harness.setpoints.position[0][0] == pytest.approx(0.1)
    assert execution.outcome is Outcome.SUCCEEDED
    harness.setpoints.assert_smooth(peak(execution))


def test_planning_that_is_always_too_late_is_rejected(
    harness: Harness, while_planning: Callable[..., list[float]]
) -> None:
    with harness.goal(FAR, seconds=30.0) as first:
        harness.run(0.2)
        delays_s = [joint_motion.TAKEOVER_LEAD_S * 2**attempt + 0.01 for attempt in range(20)]
        starts = while_planning(*[partial(harness.run, delay_s) for delay_s in delays_s])
        with pytest.raises(NotReady, match="did not go on as planned for, 8 times"):
            harness.goal(HOME).__enter__()
        assert len(starts) == 8
        assert not first.done
    harness.setpoints.assert_smooth(ACCELERATION)


def test_a_stop_that_takes_too_long_is_not_waited_for(
    harness: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(joint_motion, "STOP_TIMEOUT_S", 0.05)
    with harness.goal(FAR) as execution:
        harness.run(0.5)
        execution.cancel()
        harness.run(PERIOD_S)
        with pytest.raises(NotReady, match="did not come to rest"), harness.goal(HOME):
            pass
        harness.robot.groups.stop(0.01)
        assert not execution.done
    assert (execution.outcome, execution.message) == (Outcome.FAULT, ABANDONED)
    harness.run(0.5)
    assert np.abs(harness.image.velocity).max() < 0.01, "the device has stopped it"
    with harness.goal(HOME, seconds=2.0) as execution:
        pass


def test_a_goal_after_the_end_of_the_control_loop_fails_at_once(
    harness: Harness, while_planning: Callable[..., list[float]]
) -> None:
    while_planning(harness.robot.control_loop.stop)
    with harness.goal(FAR) as execution:
        assert (execution.outcome, execution.message) == (Outcome.FAULT, NOT_RUNNING)


def test_the_end_of_the_control_loop_ends_the_running_goal(harness: Harness) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.1)
        with harness.goal(HOME, start_in_s=1.0) as second:
            harness.robot.control_loop.stop()
            assert [first.outcome, second.outcome] == [Outcome.FAULT] * 2


def test_a_request_that_is_planned_late_does_not_preempt_a_newer_one(harness: Harness) -> None:
    """Workers take up goals in any order."""
    motion, names = harness.robot.groups.only.motion, harness.robot.joint_names
    older, newer = motion.ticket(), motion.ticket()
    request = TrajectoryRequest.from_rows(names, [1.0], [[0.3] * len(names)])
    with harness.follower.follow(request, ticket=newer) as execution:
        with pytest.raises(NotReady, match="preempted by a new goal"):
            harness.follower.follow(request, ticket=older).__enter__()
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED


def test_a_source_that_takes_long_to_make_starts_later(
    harness: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the points of a device that interpolates, on a busy computer."""
    make, names = trajectory_follower.StreamedTrajectory, harness.robot.joint_names

    def slow(*arguments: Any, **options: Any) -> TrajectoryExecution:
        harness.run(0.02)
        return make(*arguments, **options)

    monkeypatch.setattr(trajectory_follower, "StreamedTrajectory", slow)
    request = TrajectoryRequest.from_rows(names, [1.0], [[0.3] * len(names)])
    with harness.follower.follow(request) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED
