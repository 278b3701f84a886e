"""On splines: trajectories stop as fast as the joints can, and end only at their last point."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

from robotd.clock import NANOSECONDS
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.device.axes import Jog, Move
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, Operation
from robotd.motion import TrajectoryRequest
from robotd.motion.profile import Profile
from robotd.robot import Robot
from robotd_wmx._native import CallError, Device, Snapshot
from robots import JOINTS, eventually, goal, running
from standin_port import port

GENTLE_S, GENTLE_RAD = 20.0, 6.0 * 0.3
LIMIT_RAD_S2 = 12.57  # of every joint of CR3A
REACTION_S = 0.3  # for a cancel to reach the engine on a busy computer


@contextmanager
def gentle_motion(robot: Robot) -> Iterator[TrajectoryExecution]:
    """A two-point goal that accelerates with 0.03 rad/s², at some speed."""
    with robot.follower.follow(goal([GENTLE_S], GENTLE_RAD)) as execution:
        eventually(lambda: robot.image.velocity_command[0] > 0.08)
        yield execution


def at_rest(robot: Robot) -> Callable[[], bool]:
    return lambda: bool((robot.image.operation == Operation.IDLE).all())


def stop_time_s(robot: Robot, stop: Callable[[], object]) -> float:
    begin_s = time.monotonic()
    stop()
    eventually(at_rest(robot))
    return time.monotonic() - begin_s


@pytest.mark.parametrize("how", ["cancel", "stop", "alarm"])
def test_a_gentle_goal_does_not_stop_gently(tmp_path: Path, how: str) -> None:
    with running(tmp_path, stream_positions=False) as robot, gentle_motion(robot) as execution:
        stops = {
            "cancel": execution.cancel,
            "stop": lambda: robot.axes.stop(range(6)),
            "alarm": lambda: port("amp_alarm", 2, 0x7500),
        }
        speed = robot.image.velocity_command[0]
        assert stop_time_s(robot, stops[how]) < speed / LIMIT_RAD_S2 * 2.0 + REACTION_S
        assert execution.wait(3.0)


def test_a_new_goal_waits_for_the_stop_and_arrives(tmp_path: Path) -> None:
    with running(tmp_path, stream_positions=False) as robot, gentle_motion(robot) as first:
        with robot.follower.follow(goal([0.5], 0.1)) as second:
            assert second.wait(30.0)
        assert second.outcome is Outcome.SUCCEEDED, second.message
        assert first.outcome is Outcome.PREEMPTED
        np.testing.assert_allclose(robot.image.position, 0.1, atol=1e-3)


def ran_otherwise(robot: Robot, change: str) -> TrajectoryExecution:
    """A trajectory of which the engine runs something else."""
    port(change, 1)
    with robot.follower.follow(goal([0.5, 1.0, 1.5, 2.0], 0.3, 0.6, 0.9, 1.2)) as execution:
        assert execution.wait(6.0)
    port("mend")
    return execution


def test_half_of_the_points_are_no_success(tmp_path: Path) -> None:
    with running(tmp_path, stream_positions=False) as robot:
        execution = ran_otherwise(robot, "half_spline")
    assert execution.outcome is Outcome.FAULT
    assert "ended the trajectory at 0.6000 rad" in execution.message
    assert "its last point is 1.2000 rad at 2.000 s" in execution.message


def test_swapped_axes_are_no_success(tmp_path: Path) -> None:
    with running(tmp_path, stream_positions=False) as robot:
        port("swapped_spline", 1)
        rows = np.array([[0.1 * joint] * 6 for joint in (1.0, 2.0)]) * np.arange(1.0, 7.0)
        with robot.follower.follow(TrajectoryRequest(JOINTS, np.array([0.5, 1.0]), rows)) as run:
            assert run.wait(6.0)
    assert run.outcome is Outcome.FAULT
    assert "its last point is" in run.message


def test_an_early_arrival_is_no_success(tmp_path: Path) -> None:
    with running(tmp_path, stream_positions=False) as robot:
        execution = ran_otherwise(robot, "fast_spline")
    assert execution.outcome is Outcome.FAULT
    assert "the device ended a trajectory of 2.000 s after 1." in execution.message


def test_a_steering_axis_stops_with_the_ramp_of_steering(tmp_path: Path) -> None:
    """6 rad/s², by samples of a busy computer; that of the wheels is 10."""
    port("topology", 2, 0)
    samples: list[tuple[float, float]] = []  # time in s, speed
    with running(tmp_path, "tricycle_base", units_per_si=1000.0) as robot:
        assert robot.base is not None

        def steers_back() -> bool:
            """Steer to and fro, until it is seen on its way back."""
            robot.base.command(0.5, 1.0 if time.monotonic() % 3.0 < 1.5 else -1.0)
            return robot.image.velocity_command[1] < -1.4

        def note(image: ProcessImage) -> None:
            samples.append((image.fresh_ns / NANOSECONDS, -image.velocity_command[1]))

        def stopped_on_its_way() -> bool:
            """Not where a busy computer lets the stop come when steering has turned round."""
            robot.base.command(0.0, 0.0)  # re-arms it
            eventually(steers_back)
            samples.clear()
            robot.axes.stop([1])
            eventually(lambda: len(samples) > 3 and samples[-1][1] == 0.0)
            return samples[0][1] > 1.2

        robot.control_loop.every(200, "test", note)
        eventually(stopped_on_its_way)
    times_s, speeds = np.array(samples).T
    ramp = (speeds < 1.2) & (speeds > 0.1)
    assert ramp.sum() >= 2
    assert np.polyfit(times_s[ramp], speeds[ramp], 1)[0] == pytest.approx(-6.0, rel=0.3)


@pytest.mark.parametrize(
    ("motion", "end"), [("move", "stop"), ("jog", "quick_stop"), ("trajectory", "stop")]
)
def test_a_stop_needs_no_status(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, motion: str, end: str
) -> None:
    def unreadable(_: Device) -> Snapshot:
        raise CallError("GetStatus", "core motion", 1, "", "")

    with running(tmp_path, stream_positions=False) as robot, ExitStack() as goals:
        if motion == "trajectory":
            goals.enter_context(robot.follower.follow(goal([GENTLE_S], GENTLE_RAD)))
        elif motion == "move":
            robot.axes.move([Move(0, 3.0, Profile(0.5, 5.0, 5.0))])
        else:
            robot.axes.set_command_mode(0, CommandMode.VELOCITY)
            robot.axes.jog([Jog(0, Profile(0.5, 5.0, 5.0))])
        eventually(lambda: robot.image.velocity_command[0] > 0.08)
        monkeypatch.setattr("robotd_wmx.axes.Snapshot", unreadable)
        getattr(robot.axes._driver, end)(range(6))
        eventually(at_rest(robot), 3.0)
        assert robot.image.servo_on[0]
