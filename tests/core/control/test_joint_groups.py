"""Joint groups on one device: goals and streams at the same time, shared stop and speed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from tests.core.control.harness import ACCELERATION, PERIOD_S, Harness, arm

from robotd.clock import NANOSECONDS
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.device.state import Operation
from robotd.errors import InvalidArgument, NotReady
from robotd.motion import TrajectoryRejected, TrajectoryRequest

LEFT, RIGHT = ("joint1", "joint2"), ("joint4", "joint3")  # a group has an order of its own
GROUPS = {"left": {"joints": list(LEFT)}, "right": {"joints": list(RIGHT)}}
COLUMNS = {"left": [0, 1], "right": [3, 2]}
FAR = (1.0, -0.6)


@pytest.fixture
def harness() -> Iterator[Harness]:
    harness = Harness(arm(4, groups=GROUPS)).up()
    yield harness
    harness.robot.shutdown()


@contextmanager
def goal(
    harness: Harness, group: str, seconds: float, start_ns: int | None = None
) -> Iterator[TrajectoryExecution]:
    """Let a group go to ``FAR``; leaving the block stops it."""
    found = harness.robot.groups[group]
    request = TrajectoryRequest.from_rows(found.joint_names, [seconds], [FAR])
    with found.follower.follow(request, start_ns=start_ns) as execution:
        yield execution


def assert_on_path(harness: Harness, group: str, execution: TrajectoryExecution) -> None:
    """Assert that every setpoint of the goal's time is a point of its path, to the bit."""
    times_s = harness.setpoints.due_s - execution.start_ns / NANOSECONDS
    on_way = (times_s >= 0.0) & (times_s <= execution.trajectory.duration_s)
    assert on_way.sum() > execution.trajectory.duration_s / PERIOD_S - 2
    path = execution.trajectory.evaluate(times_s[on_way])[0]
    sent = harness.setpoints.position[on_way][:, COLUMNS[group]]
    assert np.abs(sent - path).max() < 1e-9


def test_goals_of_two_groups_run_at_the_same_time(harness: Harness) -> None:
    with goal(harness, "left", 1.0) as left:
        harness.run(0.3)
        with goal(harness, "right", 2.0) as right:
            harness.end(left)
            assert not right.done
            harness.end(right)
    assert (left.outcome, right.outcome) == (Outcome.SUCCEEDED, Outcome.SUCCEEDED)
    assert harness.image.position == pytest.approx([1.0, -0.6, -0.6, 1.0], abs=1e-3)
    harness.setpoints.assert_smooth(ACCELERATION)
    assert_on_path(harness, "left", left)
    assert_on_path(harness, "right", right)


def test_goals_with_one_start_time_begin_in_the_same_period(harness: Harness) -> None:
    start_ns = harness.clock.now_ns() + NANOSECONDS // 2
    with goal(harness, "left", 1.0, start_ns), goal(harness, "right", 1.0, start_ns) as right:
        harness.end(right)
    velocity = harness.setpoints.velocity
    first = [int(np.flatnonzero(velocity[:, joint])[0]) for joint in range(4)]
    assert len(set(first)) == 1


def test_cancelling_one_group_does_not_disturb_the_other(harness: Harness) -> None:
    with goal(harness, "right", 2.0) as right:
        harness.run(0.2)
        with goal(harness, "left", 1.0) as left:
            harness.run(0.5)
            left.cancel()
            harness.end(left)
        with goal(harness, "left", 0.8) as again:
            harness.end(again)
        harness.end(right)
    assert left.outcome is Outcome.CANCELED
    assert (again.outcome, right.outcome) == (Outcome.SUCCEEDED, Outcome.SUCCEEDED)
    assert_on_path(harness, "right", right)
    harness.setpoints.assert_smooth(ACCELERATION)


def test_a_newer_goal_of_a_group_takes_over_that_group_only(harness: Harness) -> None:
    with goal(harness, "left", 1.0) as left, goal(harness, "right", 1.0) as right:
        harness.run(0.4)
        with goal(harness, "left", 1.5) as newer:
            harness.end(newer)
    assert (left.outcome, newer.outcome) == (Outcome.PREEMPTED, Outcome.SUCCEEDED)
    assert right.outcome is Outcome.SUCCEEDED
    assert_on_path(harness, "right", right)


def test_a_stop_ends_all_groups(harness: Harness) -> None:
    with goal(harness, "left", 1.0) as left, goal(harness, "right", 2.0) as right:
        harness.run(0.5)
        harness.robot.stop()
    assert (left.outcome, right.outcome) == (Outcome.STOPPED, Outcome.STOPPED)
    harness.setpoints.assert_smooth(ACCELERATION)
    with pytest.raises(NotReady, match="motion is stopped"), goal(harness, "left", 1.0):
        pass


def test_speed_and_pause_are_those_of_all_groups(harness: Harness) -> None:
    with goal(harness, "left", 1.0) as left, goal(harness, "right", 1.0) as right:
        harness.robot.set_speed(0.5)
        harness.run(0.6)
        assert (left.rate, right.rate) == (0.5, 0.5)
        harness.robot.pause()
        harness.run(0.6)
        assert (left.rate, right.rate) == (0.0, 0.0)
        before = harness.image.position_command.copy()
        harness.run(0.2)
        assert (harness.image.position_command == before).all()
        harness.robot.resume()
        harness.end(left)
        harness.end(right)
    assert (left.outcome, right.outcome) == (Outcome.SUCCEEDED, Outcome.SUCCEEDED)


def test_a_fault_of_a_drive_ends_the_goals_of_its_group(harness: Harness) -> None:
    with goal(harness, "left", 1.0) as left, goal(harness, "right", 1.0) as right:
        harness.run(0.41)
        harness.faults.trip(0, 16)
        harness.end(left)
        harness.end(right)
    assert left.outcome is Outcome.FAULT
    assert left.message.startswith("joint1 at 0.4")
    assert right.outcome is Outcome.SUCCEEDED, right.message
    assert_on_path(harness, "right", right)
    with pytest.raises(NotReady, match="joint1: amplifier alarm"), goal(harness, "left", 1.0):
        pass
    harness.robot.recover()
    with goal(harness, "left", 1.0) as again:
        assert harness.end(again).outcome is Outcome.SUCCEEDED


def test_the_loss_of_the_device_ends_all_goals(harness: Harness) -> None:
    with goal(harness, "left", 1.0) as left, goal(harness, "right", 1.0) as right:
        harness.run(0.4)
        harness.robot.fault_injector.freeze(True)
        harness.end(left)
        harness.end(right)
        harness.robot.fault_injector.freeze(False)
    assert (left.outcome, right.outcome) == (Outcome.FAULT, Outcome.FAULT)


def test_a_stream_runs_beside_a_goal(harness: Harness) -> None:
    with goal(harness, "right", 2.0) as right, harness.robot.groups["left"].stream() as stream:
        assert stream.joints == LEFT
        while not right.done:
            stream.send([0.4 * math.sin(3.0 * harness.now_s), 0.2])
            harness.run(0.02)
    assert right.outcome is Outcome.SUCCEEDED
    assert stream.message == "closed by the client"
    assert_on_path(harness, "right", right)
    harness.setpoints.assert_smooth(ACCELERATION)
    assert harness.image.position[1] == pytest.approx(0.2, abs=2e-3)


def test_a_client_owns_the_joints_of_its_group(harness: Harness) -> None:
    robot, left = harness.robot, harness.robot.groups["left"]
    with goal(harness, "left", 1.0), robot.groups["right"].stream(owner="policy"):
        owners = [robot.axes.owner(axis) for axis in range(4)]
        assert owners == ["trajectory"] * 2 + ["policy"] * 2
        with pytest.raises(NotReady, match="joint1: in use by trajectory"):
            left.stream(owner="policy")
        with (
            pytest.raises(NotReady, match="joint4: in use by policy"),
            goal(harness, "right", 1.0),
        ):
            pass
        with pytest.raises(NotReady, match="joint4: in use by policy"):
            harness.move(3, 0.1)
    assert [robot.axes.owner(axis) for axis in range(4)] == [""] * 4


def test_joints_that_no_group_has_claimed_can_be_moved_singly(harness: Harness) -> None:
    with goal(harness, "left", 1.0) as left:
        harness.run(0.2)
        harness.move(2, 0.3)
        harness.end(left)
        harness.until(lambda: harness.axes_in(Operation.IDLE) == [2, 3])
    assert left.outcome is Outcome.SUCCEEDED
    assert harness.image.position[2] == pytest.approx(0.3, abs=1e-3)


def test_joints_of_another_group_are_rejected(harness: Harness) -> None:
    left = harness.robot.groups["left"]
    request = TrajectoryRequest.from_rows(("joint1", "joint3"), [1.0], [FAR])
    with pytest.raises(TrajectoryRejected, match="joint3"):
        left.follower.follow(request).__enter__()
    with pytest.raises(InvalidArgument, match=r"joint3 is unknown \(available: joint1, joint2\)"):
        left.stream(["joint3"])


def test_the_group_is_found_by_its_joints(harness: Harness) -> None:
    groups = harness.robot.groups
    assert groups.of(["joint3", "joint4"]) is groups["right"]
    with pytest.raises(InvalidArgument, match="joint1 in left, joint3 in right"):
        groups.of(["joint1", "joint3"])
    with pytest.raises(InvalidArgument, match="unknown joint 'joint5'"):
        groups.of(["joint5"])
    with pytest.raises(InvalidArgument, match=r"several groups: use groups.*left, right"):
        _ = harness.robot.follower


def test_a_robot_without_groups_has_one_of_all_joints() -> None:
    robot = Harness().robot
    assert list(robot.groups) == ["joints"]
    assert robot.groups.only.joint_names == robot.joint_names
    assert robot.follower is robot.groups["joints"].follower
    assert len(robot.mixer._slots) == 1


def test_all_groups_come_to_rest_together(harness: Harness) -> None:
    start_ns = harness.clock.now_ns() + NANOSECONDS // 10
    with (
        goal(harness, "left", 1.0, start_ns) as left,
        goal(harness, "right", 1.0, start_ns) as right,
    ):
        harness.run(0.6)  # the stop takes 60 periods from here
        harness.robot.groups.stop()
        assert (left.outcome, right.outcome) == (Outcome.CANCELED, Outcome.CANCELED)
    moving = np.abs(harness.setpoints.velocity) > 1e-3
    last = [int(np.flatnonzero(moving[:, joint])[-1]) for joint in (0, 3)]
    assert abs(last[0] - last[1]) <= 1


def test_a_group_that_was_moved_singly_stays_when_the_other_streams(harness: Harness) -> None:
    """A slot without a source holds its joints where they are, not where it left them."""
    with goal(harness, "left", 0.5) as left:
        harness.end(left)
    harness.move(0, 0.2)
    harness.until(lambda: harness.axes_in(Operation.IDLE) == [0, 1, 2, 3])
    with goal(harness, "right", 1.0) as right, harness.robot.groups["left"].stream():
        harness.end(right)
    assert harness.image.position[0] == pytest.approx(0.2, abs=1e-3)
