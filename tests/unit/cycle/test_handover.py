"""What happens while a goal is being planned: it must fit what runs when it is handed over."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from tests.unit.cycle.rig import ACCELERATION, PERIOD_S, Rig

from robotd.cycle import follower
from robotd.cycle.execution import Execution, Outcome
from robotd.cycle.streamer import ABANDONED, NOT_RUNNING
from robotd.errors import NotReady

FAR = (1.0, -0.6, 0.3)
HOME = (0.0, 0.0, 0.0)

Meanwhile = Callable[[], Any]


@pytest.fixture
def rig() -> Rig:
    return Rig().up()


@pytest.fixture
def while_planning(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[float]]:
    """``while_planning(first, second, ...)``: what happens during the next plannings."""
    plan = follower.plan

    def install(*events: Meanwhile) -> list[float]:
        coming, starts = list(events), list[float]()

        def planned(request: Any, limits: Any, settings: Any, start: Any) -> Any:
            starts.append(float(np.abs(start.velocity).max()))
            trajectory = plan(request, limits, settings, start)
            if coming:
                coming.pop(0)()
            return trajectory

        monkeypatch.setattr(follower, "plan", planned)
        return starts

    return install


def peak(*executions: Execution) -> float:
    return max(float(each.trajectory.peaks.acceleration.value.max()) for each in executions)


def test_planning_that_takes_longer_than_its_lead_is_done_again(
    rig: Rig, while_planning: Callable[..., list[float]]
) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.2)
        starts = while_planning(lambda: rig.run(0.05), lambda: rig.run(0.05))
        with rig.goal(HOME, seconds=1.5) as second:
            assert len(starts) == 2
            rig.end(second)
    assert (first.outcome, second.outcome) == (Outcome.PREEMPTED, Outcome.SUCCEEDED)
    rig.setpoints.assert_smooth(peak(first, second))


def test_a_cancel_of_what_runs_makes_the_next_one_start_from_rest(
    rig: Rig, while_planning: Callable[..., list[float]]
) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.4)
        starts = while_planning(first.cancel)
        with rig.goal(HOME, seconds=1.5) as second:
            rig.end(second)
    assert (first.outcome, second.outcome) == (Outcome.CANCELED, Outcome.SUCCEEDED)
    assert starts[0] > 0.5
    assert starts[-1] == 0.0
    rig.setpoints.assert_smooth_streams(max(ACCELERATION, peak(second)))


def test_one_that_took_over_meanwhile_is_the_one_to_follow(
    rig: Rig, while_planning: Callable[..., list[float]]
) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.3)
        with rig.goal((-0.3, 0.4, 0.5), seconds=1.5) as second:
            # Planned to follow the first one, in time, but the second one runs by then.
            starts = while_planning(lambda: rig.run(0.025))
            rig.run(2 * PERIOD_S)
            with rig.goal(HOME, seconds=1.5) as third:
                assert len(starts) == 2
                assert second.outcome is None
                rig.end(third)
    outcomes = [first.outcome, second.outcome, third.outcome]
    assert outcomes == [Outcome.PREEMPTED, Outcome.PREEMPTED, Outcome.SUCCEEDED]
    rig.setpoints.assert_smooth(peak(first, second, third))


def test_what_runs_may_reach_its_end_meanwhile(
    rig: Rig, while_planning: Callable[..., list[float]]
) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.99)
        while_planning(lambda: rig.run(0.025))
        with rig.goal(HOME, start_in_s=0.3) as second:
            rig.end(second)
    assert (first.outcome, second.outcome) == (Outcome.SUCCEEDED, Outcome.SUCCEEDED)
    rig.setpoints.assert_smooth_streams(peak(first, second))


def test_one_that_waits_and_gets_its_turn_meanwhile_is_not_jumped_over(
    rig: Rig, while_planning: Callable[..., list[float]]
) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.5)
        with rig.goal(HOME, seconds=1.5, start_in_s=0.7) as second:
            rig.until(lambda: rig.streamer.running is first and first.done)
            # At rest now; while this one is planned the second one takes over and moves.
            while_planning(lambda: rig.run(0.6))
            with rig.goal((0.2, 0.2, 0.2), seconds=1.5) as third:
                assert second.outcome is None
                rig.end(third)
    assert second.outcome is Outcome.PREEMPTED
    assert third.outcome is Outcome.SUCCEEDED
    rig.setpoints.assert_smooth_streams(peak(first, second, third))


def test_axes_that_moved_meanwhile_are_planned_for_again(
    rig: Rig, while_planning: Callable[..., list[float]]
) -> None:
    def move() -> None:
        rig.move(0, 0.1)
        rig.run(1.0)

    starts = while_planning(move)
    with rig.goal(FAR) as execution:
        rig.end(execution)
    assert len(starts) == 2
    assert rig.setpoints.position[0][0] == pytest.approx(0.1)
    assert execution.outcome is Outcome.SUCCEEDED
    rig.setpoints.assert_smooth(peak(execution))


def test_planning_that_is_always_too_late_is_given_up(
    rig: Rig, while_planning: Callable[..., list[float]]
) -> None:
    with rig.goal(FAR, seconds=30.0) as first:
        rig.run(0.2)
        delays_s = [follower.LEAD_S * 2**attempt + 0.01 for attempt in range(20)]
        starts = while_planning(*[partial(rig.run, delay_s) for delay_s in delays_s])
        with pytest.raises(NotReady, match="did not go on as planned for, 8 times"):
            rig.goal(HOME).__enter__()
        assert len(starts) == 8
        assert not first.done
    rig.setpoints.assert_smooth(ACCELERATION)


def test_a_stop_that_takes_too_long_is_not_waited_for(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(follower, "STOP_TIMEOUT_S", 0.05)
    with rig.goal(FAR) as execution:
        rig.run(0.5)
        execution.cancel()
        rig.run(PERIOD_S)
        with pytest.raises(NotReady, match="did not come to rest"), rig.goal(HOME):
            pass
        rig.follower.stop(0.01)
        assert not execution.done
    assert (execution.outcome, execution.message) == (Outcome.FAULT, ABANDONED)
    rig.run(0.5)
    assert np.abs(rig.image.velocity).max() < 0.01, "the device has stopped it"
    with rig.goal(HOME, seconds=2.0) as execution:
        pass


def test_a_goal_that_comes_after_the_cycle_ended_is_over_at_once(
    rig: Rig, while_planning: Callable[..., list[float]]
) -> None:
    while_planning(rig.robot.cycle.stop)
    with rig.goal(FAR) as execution:
        assert (execution.outcome, execution.message) == (Outcome.FAULT, NOT_RUNNING)


def test_the_end_of_the_cycle_is_the_end_of_what_runs(rig: Rig) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.1)
        with rig.goal(HOME, start_in_s=1.0) as second:
            rig.robot.cycle.stop()
            assert [first.outcome, second.outcome] == [Outcome.FAULT] * 2
