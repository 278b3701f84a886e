"""Goals with a velocity at their last point: passage, run-out to rest, and takeover."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from tests.core.control.harness import ACCELERATION, PERIOD_S, Harness, arm
from tests.core.motion.helpers import peaks_of
from tests.fakes import FakeAxes

from robotd.control.groups.trajectory_follower import TrajectoryFollower
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.motion_limits import MotionLimits
from robotd.errors import NotReady
from robotd.events import EventKind, Level
from robotd.motion import JointTolerance, TrajectoryRejected, TrajectoryRequest

GOAL_S = 1.0
POINT = (0.4, -0.2, 0.1)
VELOCITY = (0.8, -0.4, 0.2)
BRAKING_S = 0.2
END = np.array(POINT) + 0.5 * BRAKING_S * np.array(VELOCITY)


@pytest.fixture
def harness() -> Iterator[Harness]:
    trajectory = {"allow_nonzero_velocity_at_trajectory_end": True}
    harness = Harness(arm(trajectory=trajectory, stream={"takeover": True})).up()
    yield harness
    harness.robot.shutdown()


def passing(harness: Harness) -> TrajectoryRequest:
    """Return a goal that passes ``POINT``."""
    names = harness.robot.joint_names
    return TrajectoryRequest.from_rows(names, [GOAL_S], [POINT], [VELOCITY])


def test_the_result_comes_when_the_last_point_is_passed_and_the_joints_come_to_rest(
    harness: Harness,
) -> None:
    with harness.follower.follow(passing(harness)) as execution:
        harness.until(lambda: execution.outcome is not None)
        assert execution.outcome is Outcome.SUCCEEDED
        assert not execution.done
        assert execution.message.startswith("goal passed after 1.000 s")
        passed_s = harness.now_s - execution.start_ns * 1e-9
        assert passed_s == pytest.approx(GOAL_S, abs=0.02)
        assert np.abs(harness.image.velocity[:3]).max() > 0.5
        harness.end(execution)
    assert execution.completion.outcome is Outcome.SUCCEEDED
    assert harness.image.position == pytest.approx(END, abs=1e-3)
    assert harness.setpoints.position[-1] == pytest.approx(END, abs=1e-9)
    assert harness.setpoints.velocity[-1] == pytest.approx([0.0] * 3, abs=1e-9)
    harness.setpoints.assert_smooth(max(peaks_of(execution.trajectory).acceleration.value))


def test_leaving_the_context_after_the_result_waits_for_rest(harness: Harness) -> None:
    with harness.follower.follow(passing(harness)) as execution:
        harness.until(lambda: execution.outcome is not None)
    assert execution.done
    assert harness.setpoints.position[-1] == pytest.approx(END, abs=1e-9)


@pytest.mark.parametrize("after_s", [0.9, GOAL_S + 0.01, GOAL_S + 0.06])
def test_a_goal_that_comes_before_or_at_the_end_takes_over_without_a_standstill(
    harness: Harness, after_s: float
) -> None:
    with harness.follower.follow(passing(harness)) as first:
        harness.run(after_s)
        with harness.goal((1.5, -0.8, 0.4), seconds=1.5) as second:
            harness.end(second)
    assert first.outcome is (Outcome.SUCCEEDED if after_s > GOAL_S else Outcome.PREEMPTED)
    assert second.outcome is Outcome.SUCCEEDED, second.message
    times_s = harness.setpoints.due_s - first.start_ns * 1e-9
    between = (times_s > 0.9) & (times_s < 1.5)
    assert np.abs(harness.setpoints.velocity[between, 0]).min() > 0.1
    peak = max(
        peaks_of(execution.trajectory).acceleration.value.max() for execution in (first, second)
    )
    harness.setpoints.assert_smooth(max(float(peak), ACCELERATION))


def test_a_stream_takes_over_behind_the_last_point(harness: Harness) -> None:
    with harness.follower.follow(passing(harness)) as execution:
        harness.until(lambda: execution.outcome is not None)
        with harness.robot.stream(takeover=True) as stream:
            for _ in range(50):
                stream.send_velocity(VELOCITY)
                harness.run(0.01)
            assert harness.image.velocity[:3] == pytest.approx(VELOCITY, abs=0.05)
    behind = harness.setpoints.due_s - execution.start_ns * 1e-9 > GOAL_S
    before_the_stop = harness.setpoints.velocity[behind][: round(0.3 / PERIOD_S)]
    assert before_the_stop[:, 0].min() > 0.2


def test_a_stop_behind_the_last_point_ends_the_motion_and_not_the_result(harness: Harness) -> None:
    with harness.follower.follow(passing(harness)) as execution:
        harness.until(lambda: execution.outcome is not None)
        harness.robot.stop("a test")
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED
    assert execution.completion.outcome is Outcome.STOPPED
    events, _ = harness.robot.axes.events.since(0)
    (result,) = (event for event in events if event.kind is EventKind.RESULT)
    assert "; after its last point: " in result.text
    assert result.level is Level.INFO  # as that of every goal that was stopped
    assert np.abs(harness.setpoints.velocity[-1]).max() < 1e-9


def test_a_cancel_behind_the_last_point_brakes_at_least_as_fast(harness: Harness) -> None:
    with harness.follower.follow(passing(harness)) as execution:
        harness.until(lambda: execution.outcome is not None)
        execution.cancel()
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED
    assert (np.abs(harness.setpoints.position[-1]) <= np.abs(END) + 1e-9).all()


def test_a_stall_behind_the_last_point_ends_at_rest(harness: Harness) -> None:
    with harness.follower.follow(passing(harness)) as execution:
        harness.until(lambda: execution.outcome is not None)
        harness.stall(0.03)
        harness.end(execution)
    assert harness.image.position == pytest.approx(END, abs=1e-3)


def test_a_joint_that_does_not_pass_the_point_is_out_of_its_goal_tolerance(
    harness: Harness,
) -> None:
    wide = [JointTolerance("joint2", position=-1.0)]
    harness.faults.block(1, True)
    tolerances = harness.follower.tolerances(path=wide)
    with harness.follower.follow(passing(harness), tolerances) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.GOAL_TOLERANCE
    assert execution.message.startswith("joint2 at 1.000 s: position error")


def test_half_the_speed_passes_the_point_with_half_the_velocity(harness: Harness) -> None:
    harness.robot.axes.speed.set(0.5)
    harness.run(1.0)
    with harness.follower.follow(passing(harness)) as execution:
        harness.until(lambda: execution.outcome is not None)
        assert harness.now_s - execution.start_ns * 1e-9 > 0.9
        assert np.abs(harness.setpoints.velocity[-1, 0]) < 0.45
        harness.end(execution)
    assert harness.image.position == pytest.approx(END, abs=1e-3)


def test_a_goal_paused_behind_its_last_point_is_stopped_before_the_joints_are_released(
    harness: Harness,
) -> None:
    harness.robot.axes.speed.set(0.2)  # the pause begins before the run-out has ended
    harness.run(1.0)
    with harness.follower.follow(passing(harness)) as execution:
        harness.until(lambda: execution.outcome is not None)
        harness.robot.axes.speed.pause()
    assert execution.outcome is Outcome.SUCCEEDED
    assert execution.completion.outcome is Outcome.CANCELED, execution.completion.message
    assert np.abs(harness.setpoints.velocity[-1]).max() < 1e-9
    assert (np.abs(harness.setpoints.position[-1]) < np.abs(END)).all()


def test_it_is_switched_on_and_off_at_run_time(harness: Harness) -> None:
    harness.follower.allow_end_velocity(False)
    request = passing(harness)
    with pytest.raises(TrajectoryRejected, match="must be 0"), harness.follower.follow(request):
        pass
    harness.follower.allow_end_velocity(True)
    with harness.follower.follow(request) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED


def test_a_device_that_interpolates_by_itself_rejects_it(harness: Harness) -> None:
    robot = harness.robot
    on_device = TrajectoryFollower(
        robot.groups.only.motion,
        robot.axes,
        robot.descriptor,
        MotionLimits(),
        FakeAxes(3),
    )
    why = "interpolates trajectories itself ends them at rest"
    with pytest.raises(TrajectoryRejected, match=why), on_device.follow(passing(harness)):
        pass


def test_the_joints_have_an_owner_until_they_rest(harness: Harness) -> None:
    with harness.follower.follow(passing(harness)) as execution:
        harness.until(lambda: execution.outcome is not None)
        with pytest.raises(NotReady, match="in use by trajectory"):
            harness.move(0, 0.0)
        harness.end(execution)
