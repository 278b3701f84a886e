"""Whole robots on the engine: what a user sees, in good and in bad times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog, Move
from robotd.device.state import ConnectionState, Operation
from robotd.errors import OperationError
from robotd.motion import JointTolerance
from robotd.motion.profile import Profile
from robotd.robot import Robot
from robots import eventually, goal, running
from standin_port import port

PROFILE = Profile(1.0, 10.0, 10.0)


def settled(robot: Robot) -> bool:
    return bool((robot.image.operation == Operation.IDLE).all())


def test_cr3a_comes_up_moves_and_goes_down(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        assert robot.connection.state is ConnectionState.COMMUNICATING
        assert robot.image.copy().servo_on.all()
        robot.axes.move([Move(0, 0.3, PROFILE), Move(5, -0.2, PROFILE)])
        eventually(lambda: robot.image.motion_complete[0] and robot.image.motion_complete[5])
        eventually(lambda: np.allclose(robot.image.position[[0, 5]], [0.3, -0.2], atol=1e-6))
    assert robot.connection.state is ConnectionState.SHUTDOWN
    assert "engine 0" in port("show")


def test_a_trajectory_runs_as_a_spline_on_the_engine(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        with robot.follower.follow(goal([0.25, 0.5], 0.1, 0.2)) as execution:
            eventually(lambda: bool((robot.image.operation == Operation.STREAM).all()))
            assert execution.wait(30.0)
        assert execution.outcome is Outcome.SUCCEEDED, execution.message
        np.testing.assert_allclose(robot.image.position, 0.2, atol=1e-3)


def test_the_engine_follows_the_planned_path(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        samples: list[tuple[float, float]] = []
        clock = robot.clock
        robot.control_loop.every(
            500, "test", lambda image: samples.append((clock.now_ns(), image.position_command[2]))
        )
        with robot.follower.follow(goal([0.3, 0.5, 0.8], 0.2, 0.1, 0.3)) as execution:
            assert execution.wait(30.0)
        times_s, positions = np.array(samples).T
        start = int(np.flatnonzero(positions > 1e-6)[0])
        planned = execution.trajectory.evaluate((times_s - times_s[start - 1]) * 1e-9)[0][:, 2]
        # A millisecond or two of latency at no more than 1.5 rad/s.
        late = np.abs(positions[start:] - planned[start:])
        assert np.median(late) < 0.01


def test_a_new_goal_takes_over_at_rest_and_a_rejected_one_does_not(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        with robot.follower.follow(goal([2.0], 1.0)) as first:
            eventually(lambda: robot.image.position[0] > 0.05)
            with pytest.raises(OperationError, match="joint1"):
                robot.follower.follow(goal([0.5], 9.0)).__enter__()
            assert not first.completion.requested
            with robot.follower.follow(goal([0.5], 0.0)) as second:
                assert second.wait(30.0)
        assert first.outcome is Outcome.PREEMPTED
        assert second.outcome is Outcome.SUCCEEDED, second.message


def test_cancel_stops_along_the_path(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        with robot.follower.follow(goal([2.0], 1.0)) as execution:
            eventually(lambda: robot.image.position[0] > 0.1)
            execution.cancel()
            assert execution.wait(30.0)
        assert execution.outcome is Outcome.CANCELED
        assert settled(robot)
        np.testing.assert_allclose(robot.image.position, robot.image.position[0], atol=1e-4)
        assert robot.image.position[0] < 0.9


@pytest.mark.parametrize("stream_positions", [True, False])
def test_a_joint_that_did_not_follow_stays_where_it_is_when_it_is_freed(
    tmp_path: Path, stream_positions: bool
) -> None:
    with running(tmp_path, stream_positions=stream_positions) as robot:
        port("stuck", 3, 1)
        tolerances = robot.follower.tolerances([JointTolerance("joint4", 0.05)])
        with robot.follower.follow(goal([1.0], 1.0), tolerances) as execution:
            assert execution.wait(30.0)
        assert execution.outcome is Outcome.PATH_TOLERANCE
        assert "joint4" in execution.message
        positions: list[float] = []
        robot.control_loop.every(500, "test", lambda image: positions.append(image.position[3]))
        eventually(lambda: len(positions) > 10)
        port("stuck", 3, 0)
        freed = len(positions)
        eventually(lambda: len(positions) > freed + 200)
        assert robot.image.servo_on[3]
        assert np.ptp(positions) < 0.01


def test_baymax_drives_by_streamed_velocities(tmp_path: Path) -> None:
    port("topology", 2, 0)
    with running(tmp_path, "baymax") as robot:
        assert robot.base is not None

        def fast() -> bool:
            robot.base.command(0.3, 0.0)
            return bool((np.abs(robot.image.velocity) > 3.0).all())

        eventually(fast)
        assert (robot.image.operation == Operation.STREAM).all()
        eventually(lambda: settled(robot) and bool((np.abs(robot.image.velocity) < 1e-3).all()))
        assert abs(robot.image.position[0] - robot.image.position[1]) < 0.05


def test_a_limit_switch_stops_a_move(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.axes.move([Move(0, 1.0, PROFILE)])
        eventually(lambda: robot.image.position[0] > 0.05)
        port("positive_limit", 0, 1)
        eventually(lambda: settled(robot))
        assert robot.image.positive_limit[0]
        assert not robot.image.motion_complete[0]
        assert robot.image.position[0] < 0.9


def test_jog_in_velocity_mode_and_stop(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.axes.set_command_mode(1, 1)
        robot.axes.jog([Jog(1, Profile(-0.5, 5.0, 5.0))])
        eventually(lambda: abs(robot.image.velocity[1] + 0.5) < 0.01)
        robot.axes.jog([Jog(1, Profile(0.0, 5.0, 5.0))])
        eventually(lambda: settled(robot))
