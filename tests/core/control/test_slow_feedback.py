"""Feedback at 125 Hz in a control loop of 500 Hz: the age of a value is not a following error."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from tests.core.control.harness import arm
from tests.features.conformance.runs.whole_arm import ArmAxes, WholeArm

from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.trajectory_execution import CommandHistory
from robotd.device.axes import Jog
from robotd.device.state import CommandMode, Operation
from robotd.motion import JointTolerance, TrajectoryRequest
from robotd.motion.profile import Profile
from robotd.plugin.manager import Backend, PluginOrigin
from robotd.robot import Robot

TOLERANCE_RAD = 0.009  # at 2.7 rad/s: 3.3 ms
MS = 1_000_000


@pytest.fixture
def robot() -> Iterator[Robot]:
    """An arm whose imaginary controller reaches each target at once and reports every 8 ms."""
    origin = PluginOrigin("whole", "tests.features.conformance.runs.whole_arm", "whole", "1.0")
    robot = Robot(arm(), Backend(origin, WholeArm()), SteppedClock())
    robot.start()
    yield robot
    robot.shutdown()


def until_done(robot: Robot, seconds: float = 1.0) -> tuple[Outcome | None, str, float]:
    """Follow 1.5 rad in ``seconds``, with a path tolerance; return outcome, text, largest error."""
    request = TrajectoryRequest.from_rows(robot.joint_names, [seconds], [[1.5, 0.0, 0.0]])
    tolerances = robot.follower.tolerances([JointTolerance("joint1", TOLERANCE_RAD)])
    with robot.follower.follow(request, tolerances) as execution:
        for _ in range(2000):
            if execution.done:
                break
            robot.step(1)
    return execution.outcome, execution.message, float(execution.max_error[0])


def test_an_old_value_is_compared_with_the_command_of_its_time(robot: Robot) -> None:
    outcome, message, error = until_done(robot)
    assert outcome is Outcome.SUCCEEDED, message
    assert error <= TOLERANCE_RAD


def test_a_late_command_is_still_a_following_error(robot: Robot) -> None:
    """The controller is slower than the path: its values are as old as before."""
    wrapped: ArmAxes = vars(robot.axes._driver)["wrapped"]
    wrapped.max_velocity = 2.0
    outcome, message, _ = until_done(robot)
    assert outcome is Outcome.PATH_TOLERANCE, message


def test_a_goal_that_takes_over_in_motion_knows_the_age_too(robot: Robot) -> None:
    joints, tolerance = robot.joint_names, [JointTolerance("joint1", TOLERANCE_RAD)]
    first = TrajectoryRequest.from_rows(joints, [1.0], [[1.5, 0.0, 0.0]])
    with robot.follower.follow(first, robot.follower.tolerances(tolerance)):
        robot.step(250)
        next_one = TrajectoryRequest.from_rows(joints, [1.0], [[2.5, 0.0, 0.0]])
        with robot.follower.follow(next_one, robot.follower.tolerances(tolerance)) as execution:
            for _ in range(1000):
                robot.step(1)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message


def test_feedback_shows_desired_and_measured_values_of_one_time(robot: Robot) -> None:
    request = TrajectoryRequest.from_rows(robot.joint_names, [1.0], [[1.5, 0.0, 0.0]])
    with robot.follower.follow(request) as execution:
        for _ in range(200):
            robot.step(1)
            progress = execution.progress()
            error = progress.desired_position - progress.actual_position
            assert np.abs(error).max() <= TOLERANCE_RAD


def test_a_jog_ends_within_its_limit_although_its_position_is_old(robot: Robot) -> None:
    robot.axes.set_command_mode(0, CommandMode.VELOCITY)
    robot.axes.jog([Jog(0, Profile(2.9, 12.0, 12.0))])
    robot.step(1500)
    assert robot.image.operation[0] == Operation.IDLE
    assert 2.8 < robot.image.position[0] <= 3.0


def test_a_command_waits_for_values_that_are_newer_than_itself(robot: Robot) -> None:
    robot.step(1)
    began_ns = robot.clock.now_ns()
    robot.axes._waits.for_newer(robot.clock.now_ns())
    assert robot.image.fresh_ns > began_ns
    assert robot.clock.now_ns() - began_ns <= 10 * MS


def test_a_command_between_two_is_interpolated_and_before_the_first_extrapolated() -> None:
    history, out = CommandHistory(), np.zeros((2, 1))
    history.add(10 * MS, np.array([[1.0], [2.0]]))
    assert history.recall(6 * MS, out) == pytest.approx(4e-3)
    assert out[:, 0] == pytest.approx([1.0 - 8e-3, 2.0])
    history.add(12 * MS, np.array([[1.006], [4.0]]))
    history.add(14 * MS, np.array([[1.02], [6.0]]))
    assert history.recall(13 * MS, out) == pytest.approx(1e-3)
    assert out[:, 0] == pytest.approx([1.013, 5.0])
    assert history.recall(15 * MS, out) == 0.0
    assert out[:, 0] == pytest.approx([1.02, 6.0])


def test_a_history_keeps_no_more_than_the_age_of_the_values() -> None:
    history, out = CommandHistory(), np.zeros((2, 1))
    for period in range(1000):
        history.add(2 * MS * period, out)
        history.recall(2 * MS * (period - 4), out)
    assert len(history._commands) <= 6
