"""Speed of trajectories and of single axes: the path stays, its time is scaled."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.core.control.harness import ACCELERATION, PERIOD_S, Harness, arm, peak

from robotd.arrays import FloatArray
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.streamed_trajectory import MAX_SLOPE, MIN_SHARE
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.device.axes import Jog, Move
from robotd.device.process_image import ProcessImage
from robotd.device.speed_scale import SpeedScale
from robotd.device.state import CommandMode
from robotd.errors import InvalidArgument, NotReady
from robotd.motion.profile import Profile

HOME, FAR, BACK = (0.0, 0.0, 0.0), (1.0, -0.6, 0.3), (-0.5, 0.4, 0.9)


class Recorded:
    """Trajectory time and rate of each setpoint of an execution."""

    def __init__(self, harness: Harness, execution: TrajectoryExecution) -> None:
        self._harness, self._execution = harness, execution
        self._first = len(harness.setpoints.rows)
        self._times_s: list[float] = []
        self._rates: list[float] = []
        harness.robot.control_loop.every(1 / PERIOD_S, "path time", self._record)

    def assert_on_path(self) -> None:
        """Assert that each setpoint is a point of the path, with its speed times the rate."""
        count = len(self._times_s)
        rates = np.array(self._rates)[:, np.newaxis]
        position, velocity, _ = self._execution.trajectory.evaluate(np.array(self._times_s))
        rows = slice(self._first, self._first + count)
        assert np.abs(self._harness.setpoints.position[rows] - position).max() < 1e-9
        assert np.abs(self._harness.setpoints.velocity[rows] - velocity * rates).max() < 1e-9
        assert (np.diff(self._times_s) >= 0.0).all()
        assert np.abs(np.diff(self._rates)).max() <= MAX_SLOPE * PERIOD_S * 1.001

    def _record(self, image: ProcessImage) -> None:
        if not self._execution.done and self._execution.completion.requested is None:
            self._times_s.append(self._execution.time_s)
            self._rates.append(self._execution.rate)


def largest_acceleration(harness: Harness) -> float:
    harness.setpoints.assert_smooth(ACCELERATION * (1.0 + MIN_SHARE))
    return float(np.abs(harness.setpoints.acceleration).max())


def run_at(speed: float) -> tuple[float, Harness]:
    """Run one goal; return its duration and the harness."""
    harness = Harness().up()
    harness.robot.set_speed(speed)
    begin_s = harness.now_s
    with harness.goal(FAR, BACK) as execution:
        path = Recorded(harness, execution)
        assert harness.end(execution).outcome is Outcome.SUCCEEDED
    path.assert_on_path()
    return harness.now_s - begin_s, harness


def test_at_half_speed_the_path_is_the_same_and_takes_twice_as_long() -> None:
    full_s, full = run_at(1.0)
    half_s, half = run_at(0.5)
    assert half_s == pytest.approx(2.0 * full_s, abs=0.05)
    fastest = np.abs(full.setpoints.velocity).max(axis=0)
    assert np.abs(half.setpoints.velocity).max(axis=0) == pytest.approx(fastest / 2, rel=1e-3)
    assert largest_acceleration(half) == pytest.approx(largest_acceleration(full) / 4, rel=0.02)


@settings(max_examples=6, deadline=None)
@given(
    changes=st.lists(
        st.tuples(st.floats(0.02, 0.6), st.sampled_from([0.0, 0.01, 0.3, 0.7, 1.0])), max_size=6
    )
)
def test_changes_in_motion_are_ramped_and_keep_the_path(changes: list[tuple[float, float]]) -> None:
    harness = Harness().up()
    with harness.goal(FAR, BACK) as execution:
        path = Recorded(harness, execution)
        for seconds, speed in changes:
            harness.run(seconds)
            harness.robot.axes.speed.set(speed)
        harness.run(0.5)
        harness.robot.axes.speed.set(1.0)
        assert harness.end(execution).outcome is Outcome.SUCCEEDED
    largest_acceleration(harness)
    path.assert_on_path()
    assert execution.max_error.max() < 0.05


def test_an_override_scales_one_trajectory_beside_the_speed(harness: Harness) -> None:
    harness.robot.set_speed(0.5)
    with harness.goal(FAR, BACK) as execution:
        path = Recorded(harness, execution)
        harness.run(0.4)
        execution.override_speed(0.5)
        harness.run(0.5 / MAX_SLOPE + 0.1)
        assert execution.rate == pytest.approx(0.25)
        assert harness.end(execution).outcome is Outcome.SUCCEEDED
        path.assert_on_path()
    with harness.goal(HOME) as following:
        harness.run(0.2)
        assert following.rate == 0.5
        harness.end(following)


def test_a_pause_holds_on_the_path_and_the_goal_continues(harness: Harness) -> None:
    with harness.goal(FAR, BACK) as execution:
        path = Recorded(harness, execution)
        harness.run(0.4)
        harness.robot.pause()
        harness.run(1.0 / MAX_SLOPE + 0.1)
        held = harness.setpoints.position[-1].copy()
        time_s = execution.progress().time_s
        harness.run(3.0)
        assert harness.setpoints.position[-1] == pytest.approx(held, abs=1e-12)
        assert execution.progress().time_s == pytest.approx(time_s, abs=1e-6)
        assert execution.rate == harness.robot.follower.rate == 0.0
        harness.robot.resume()
        harness.run(0.5 / MAX_SLOPE)
        assert 0.0 < harness.robot.follower.rate < 1.0  # of the ramp, not as set
        assert harness.end(execution).outcome is Outcome.SUCCEEDED
    harness.robot.set_speed(0.3)
    assert harness.robot.follower.rate == 0.3  # of the next goal
    largest_acceleration(harness)
    path.assert_on_path()


@pytest.mark.parametrize("speed", [1.0, 0.3, 0.1])
def test_a_goal_takes_over_at_any_speed_without_a_jump(harness: Harness, speed: float) -> None:
    harness.robot.axes.speed.set(speed)
    with harness.goal(FAR, seconds=1.5) as first:
        harness.run(0.6 / speed)
        with harness.goal(BACK, seconds=1.5) as second:
            assert harness.end(second).outcome is Outcome.SUCCEEDED
        assert first.outcome is Outcome.PREEMPTED
    largest_acceleration(harness)
    assert harness.setpoints.position[-1] == pytest.approx(BACK, abs=1e-9)


@pytest.mark.parametrize("periods", [0, 1, 7, 20])
def test_a_goal_takes_over_while_the_speed_changes(harness: Harness, periods: int) -> None:
    with harness.goal(FAR, seconds=1.5) as first:
        harness.run(0.6)
        harness.robot.axes.speed.set(0.2)
        harness.run(periods * PERIOD_S)
        with harness.goal(BACK, seconds=1.5) as second:
            harness.run(0.05)
            harness.robot.axes.speed.set(0.6)
            assert harness.end(second).outcome is Outcome.SUCCEEDED
        assert first.outcome is Outcome.PREEMPTED
    largest_acceleration(harness)


def test_a_goal_that_comes_in_a_pause_takes_over_after_it(harness: Harness) -> None:
    with harness.goal(FAR, seconds=1.5) as first:
        harness.run(0.6)
        harness.robot.pause()
        harness.run(1.0)
        with harness.goal(BACK, seconds=1.5) as second:
            harness.run(1.0)
            assert (first.outcome, second.outcome) == (None, None)
            harness.robot.resume()
            assert harness.end(second).outcome is Outcome.SUCCEEDED
        assert first.outcome is Outcome.PREEMPTED
    largest_acceleration(harness)


def test_a_goal_from_rest_waits_for_the_end_of_a_pause(harness: Harness) -> None:
    harness.robot.pause()
    with harness.goal(FAR) as execution:
        harness.run(1.0)
        assert np.abs(harness.setpoints.position).max() == 0.0
        harness.robot.resume()
        assert harness.end(execution).outcome is Outcome.SUCCEEDED
    largest_acceleration(harness)


@pytest.mark.parametrize("waits_behind_a_goal", [False, True])
@pytest.mark.parametrize(("before", "then"), [(1.0, 0.0), (1.0, 0.1), (0.1, 1.0), (0.0, 0.3)])
def test_a_goal_that_waits_for_its_start_begins_with_the_speed_then_in_force(
    harness: Harness, before: float, then: float, waits_behind_a_goal: bool
) -> None:
    """Moved 0.26 rad at up to 0.8 rad/s although it was paused 4 s before; 0.194 rad/s at 10 %."""
    harness.robot.set_speed(before)
    with ExitStack() as goals:
        if waits_behind_a_goal:
            goals.enter_context(harness.goal(HOME, seconds=0.05))
        execution = goals.enter_context(harness.goal(FAR, seconds=1.0, start_in_s=5.0))
        harness.run(1.0)
        harness.robot.set_speed(then)
        harness.run(3.99)
        begin = len(harness.setpoints.rows)
        assert execution.rate == then
        harness.run(3.0)
        fastest = float(np.abs(execution.trajectory.evaluate(np.linspace(0, 1, 200))[1]).max())
        velocity = np.abs(harness.setpoints.velocity[begin:])
        assert velocity.max() <= then * fastest * 1.001
        assert (velocity.max() > 0.5 * then * fastest) or not then
        harness.robot.set_speed(1.0)
        assert harness.end(execution).outcome is Outcome.SUCCEEDED
    assert largest_acceleration(harness) > 0.0


@pytest.mark.parametrize("early_periods", [2, 1])
def test_a_pause_just_before_the_start_moves_nothing(harness: Harness, early_periods: int) -> None:
    with harness.goal(FAR, seconds=1.0, start_in_s=1.0) as execution:
        harness.run(1.0 - early_periods * PERIOD_S)
        harness.robot.pause()
        harness.run(2.0)
        assert np.abs(harness.image.position_command).max() < 1e-4
        harness.robot.resume()
        assert harness.end(execution).outcome is Outcome.SUCCEEDED
    largest_acceleration(harness)


@pytest.mark.parametrize("speed", [0.0, 0.3])
def test_a_slow_goal_is_cancelled_and_stopped_on_its_path(harness: Harness, speed: float) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.4)
        harness.robot.axes.speed.set(speed)
        harness.run(0.6)
        begin_s = harness.now_s
        execution.cancel()
        assert harness.end(execution).outcome is Outcome.CANCELED
        assert harness.now_s - begin_s < 0.3, "it brakes with its limits, not in slow motion"
    largest_acceleration(harness)
    ratio = harness.setpoints.position[-1] / np.array(FAR)
    assert ratio == pytest.approx(ratio[0]), "on the straight line to the goal"


def test_a_stall_of_the_control_loop_at_half_speed(harness: Harness) -> None:
    harness.robot.axes.speed.set(0.5)
    with harness.goal(FAR) as execution:
        harness.run(0.8)
        harness.stall(0.05)
        assert harness.end(execution).outcome is Outcome.SUCCEEDED, execution.message
    assert harness.setpoints.position[-1] == pytest.approx(FAR, abs=1e-9)


def test_moves_and_jogs_of_single_axes_take_the_speed_at_their_start() -> None:
    harness = Harness(arm(axes=4)).up()
    axes = harness.robot.axes
    axes.servo(3, True)
    axes.set_command_mode(3, CommandMode.VELOCITY)
    axes.speed.set(0.25)
    axes.jog([Jog(3, Profile(-2.0, 10.0, 10.0))])
    axes.move([Move(0, 2.0, Profile(2.0, 10.0, 10.0))])
    harness.run(0.5)
    assert harness.image.velocity[[0, 3]] == pytest.approx([0.5, -0.5], abs=0.02)
    harness.robot.pause()
    for command in (
        lambda: axes.jog([Jog(3, Profile(1.0, 10.0, 10.0))]),
        lambda: axes.move([Move(1, 2.0, Profile(1.0, 10.0, 10.0))]),
    ):
        with pytest.raises(NotReady, match="motion is paused; robotd resume allows it again"):
            command()
    axes.jog([Jog(3, Profile(0.0, 10.0, 10.0))])  # to rest: always accepted
    harness.run(0.5)
    assert harness.image.velocity[3] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("speed", [-0.1, 0.005, 1.01, float("nan"), float("inf")])
def test_a_speed_out_of_range_is_rejected(harness: Harness, speed: float) -> None:
    with pytest.raises(InvalidArgument, match=r"is neither 0 nor 0\.01 to 1"):
        harness.robot.set_speed(speed)
    assert harness.robot.axes.speed.speed == 1.0


@pytest.mark.parametrize(
    ("call", "overtaking", "result"),
    [
        (lambda speed: speed.set(0.5), lambda speed: speed.pause(), "paused (50 %)"),
        (lambda speed: speed.pause(), lambda speed: speed.set(0.5), "paused (50 %)"),
        (lambda speed: speed.resume(), lambda speed: speed.set(0.5), "50 %"),
    ],
)
def test_changes_of_two_threads_are_both_in_force(
    call: Callable[[SpeedScale], None], overtaking: Callable[[SpeedScale], None], result: str
) -> None:
    speed = SpeedScale()
    lock, first = speed._lock, [overtaking]

    class Overtaken:
        """The lock, which another thread gets first."""

        def __enter__(self) -> None:
            while first:
                first.pop()(speed)
            lock.acquire()

        def __exit__(self, *_: object) -> None:
            lock.release()

    speed._lock = Overtaken()  # type: ignore[assignment]
    call(speed)
    assert speed.text == result


def test_every_change_is_told(harness: Harness) -> None:
    told: list[float] = []
    harness.robot.axes.speed.on_change(told.append)
    harness.robot.set_speed(0.3)
    harness.robot.pause()
    harness.robot.pause()
    harness.robot.set_speed(0.5)
    harness.robot.resume()
    assert told == [1.0, 0.3, 0.0, 0.0, 0.5]


def test_a_stream_has_the_speed_of_its_start_and_ends_in_a_pause(harness: Harness) -> None:
    harness.robot.set_speed(0.2)
    with harness.robot.stream() as stream:
        for _ in range(20):
            stream.send([2.0] * 3)
            harness.run(0.05)
        assert np.abs(harness.setpoints.velocity).max() == pytest.approx(0.2 * 3.0, rel=0.01)
        harness.robot.pause()
        harness.run(1.0)
        assert stream.message == "motion is paused (20 %)"
    assert np.abs(harness.setpoints.velocity[-1]).max() < 1e-9
    harness.setpoints.assert_smooth(ACCELERATION)
    with pytest.raises(NotReady, match="motion is paused; robotd resume"):
        harness.robot.stream()


def test_a_stream_takes_over_from_a_slow_goal_and_hands_back() -> None:
    harness = Harness(arm(stream={"takeover": True})).up()
    harness.robot.set_speed(0.5)
    with harness.goal(FAR, seconds=1.0):
        harness.run(0.8)
        with harness.robot.stream(takeover=True) as stream:
            for _ in range(10):
                stream.send(list(harness.image.position_command[:3]), [0.2] * 3)
                harness.run(0.02)
            with harness.goal(BACK, seconds=3.0) as after:
                assert harness.end(after).outcome is Outcome.SUCCEEDED
    harness.setpoints.assert_smooth_streams(ACCELERATION * (1.0 + MIN_SHARE))


def test_a_goal_that_takes_over_slows_down_for_a_limit_within_the_accelerations(
    harness: Harness,
) -> None:
    """The first period of the second goal, too: it begins in motion."""
    limits = harness.robot.groups.only.motion_limits

    def factors(position: FloatArray, velocity: FloatArray) -> FloatArray:
        return 0.5 / np.maximum(np.abs(velocity).max(axis=-1), 1e-9)

    with harness.goal(FAR, seconds=2.5) as first:
        harness.run(1.0)
        limits.set_speed(factors, "a limit", "none")
        with harness.goal([2.0, -1.2, 0.6], seconds=0.9) as second:
            harness.end(second)
    assert second.outcome is Outcome.SUCCEEDED
    harness.setpoints.assert_smooth(max(peak(first, second), ACCELERATION))
