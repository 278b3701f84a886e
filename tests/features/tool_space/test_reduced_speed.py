"""Reduced speed: each kind of motion keeps it, on its path, and returns to full speed by a ramp."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.features.tool_space.arms import go

from robotd import Robot, open_robot
from robotd.api import (
    DescriptorError,
    FloatArray,
    NotReady,
    Operation,
    OperationError,
    Profile,
)
from robotd.api.robots import ProblemKind, TrajectoryRequest
from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog, Move
from robotd.robot import build_robot
from robotd_tool_space import ToolGroups
from robotd_tool_space.link_speeds import reduced_speed

BENT = np.array([0.0, 0.3, 1.4, -0.2, 1.2, 0.0])
GOAL = BENT + np.array([1.5, -1.0, 0.5, 0.5, 0.0, 1.0])
TIP = [0.05, 0.0, 0.15]
HIGHEST = 0.25 * 1.02
PERIOD_S = 0.002
FAST = Profile(3.0, 10.0, 10.0)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arm") / "robot.yaml"
    path.write_text(
        "extends: cr3a\nname: arm\ninputs: {full: 0.3}\ntool_space:\n"
        f"  velocity_m_s: 0.8\n  tool: tip\n  tools:\n    tip: {{xyz_m: {TIP}}}\n",
        encoding="utf-8",
    )
    return path


class Arm:
    """A robot on a stepped clock, with the commanded positions of each period."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.tool = robot.feature(ToolGroups).only
        self.reduced = robot.feature(reduced_speed)
        self.positions: list[FloatArray] = []

    def run(self, periods: int, end: Callable[[], bool] = lambda: False) -> None:
        for _ in range(periods):
            self.robot.step(1)
            self.positions.append(self.robot.image.position_command[:6].copy())
            if end():
                return
        assert not end(), "it has ended in time"

    def go(self, position: FloatArray) -> None:
        """Move at full speed, without record."""
        go(self.tool, position)
        self.positions.clear()

    def speeds(self) -> FloatArray:
        """Speed of the fastest of link and tip in each period, m/s, from forward kinematics."""
        poses = self.tool.at_link.forward(np.array(self.positions))
        tip = poses @ [*TIP, 1.0]
        places = np.stack([poses[:, :3, 3], tip[:, :3]])
        speeds: FloatArray = np.linalg.norm(np.diff(places, axis=1), axis=-1).max(axis=0) / PERIOD_S
        return speeds

    def accelerations(self) -> FloatArray:
        """Of each joint, rad/s²."""
        return np.diff(np.array(self.positions), 2, axis=0) / PERIOD_S**2

    def on(self) -> int:
        """Switch reduced speed on; return the number of periods so far."""
        self.reduced.set(True)
        return len(self.positions)


@pytest.fixture
def arm(file: Path) -> Iterator[Arm]:
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        arm = Arm(robot)
        arm.go(BENT)
        yield arm


def fast() -> TrajectoryRequest:
    """A goal at 0.9 m/s, with a point on the way."""
    displacement = GOAL - BENT
    positions = np.array([BENT, BENT + 0.5 * displacement, GOAL])
    return TrajectoryRequest(
        [f"joint{number}" for number in range(1, 7)],
        np.array([0.0, 0.7, 1.4]),
        positions,
        np.array([0.0 * displacement, displacement / 0.9, 0.0 * displacement]),
    )


@pytest.mark.parametrize("before", [0, 300])
def test_a_trajectory_keeps_the_speed_and_its_path(arm: Arm, before: int) -> None:
    off_path = []

    def at_end() -> bool:
        on_path, _, _ = execution.trajectory.evaluate(np.array([execution.time_s]))
        off_path.append(np.abs(arm.robot.image.setpoint[0, :6] - on_path[0]).max())
        return execution.outcome is not None

    if not before:
        arm.on()
    with arm.tool.group.follower.follow(fast()) as execution:
        if before:
            arm.run(before)
            arm.on()
        arm.run(3000, at_end)
    assert execution.outcome is Outcome.SUCCEEDED
    assert max(off_path) < 1e-9
    if before:
        assert arm.speeds()[:before].max() > 0.75
    assert arm.speeds()[before + 50 * bool(before) :].max() < HIGHEST
    assert np.median(arm.speeds()[before:]) > 0.23, "it is not slower than needed"
    assert (np.abs(arm.accelerations()) < 12.57 * 1.05).all()


def test_full_speed_returns_by_a_ramp(arm: Arm) -> None:
    arm.on()
    with arm.tool.group.follower.follow(fast()) as execution:
        arm.run(700)
        assert arm.speeds().max() < HIGHEST
        arm.reduced.set(False)
        arm.run(3000, lambda: execution.outcome is not None)
    assert arm.speeds().max() > 0.5
    assert (np.abs(arm.accelerations()) < 12.57 * 1.05).all()


def test_a_line_keeps_the_speed(arm: Arm) -> None:
    motion = arm.tool.plan_lines([arm.tool.pose_relative(y=0.3)])
    arm.on()
    with arm.tool.follow(motion) as execution:
        arm.run(3000, lambda: execution.outcome is not None)
    assert execution.outcome is Outcome.SUCCEEDED
    assert 0.24 < arm.speeds().max() < HIGHEST


def test_a_stop_keeps_the_speed_and_is_not_longer(arm: Arm) -> None:
    arm.on()
    with arm.tool.group.follower.follow(fast()) as execution:
        arm.run(500)
        execution.cancel()
        arm.run(60, lambda: execution.outcome is not None)
    assert execution.outcome is Outcome.CANCELED
    assert arm.speeds().max() < HIGHEST


@pytest.mark.parametrize("before", [0, 100])
def test_a_stream_of_positions_keeps_the_speed_and_arrives(arm: Arm, before: int) -> None:
    if not before:
        arm.on()
    with arm.tool.group.stream(timeout_s=100.0) as stream:
        stream.send(GOAL.tolist())
        if before:
            arm.run(before)
            arm.on()
        arm.run(2500, lambda: bool(np.abs(arm.positions[-1] - GOAL).max() < 1e-9))
    # At full speed of a joint it takes a quarter of a second, and the jerk limit adds to it.
    assert arm.speeds()[before + 150 * bool(before) :].max() < HIGHEST
    accelerations = arm.accelerations()
    assert (np.abs(accelerations) < 12.57 * 1.01).all()
    assert (np.abs(np.diff(accelerations, axis=0)) < 251.4 * PERIOD_S * 1.01).all()


@pytest.mark.parametrize("kind", ["positions", "velocities"])
def test_a_stream_that_changes_at_any_time_hardly_exceeds_the_speed(arm: Arm, kind: str) -> None:
    """Joints compensate each other, and one of them turns round before the other has stopped."""
    random, velocity = np.random.default_rng(1), arm.tool.group.follower.limits.velocity
    arm.on()
    with arm.tool.group.stream(timeout_s=10.0) as stream:
        for _ in range(60):
            if kind == "positions":
                stream.send((BENT + random.uniform(-1.0, 1.0, 6)).tolist())
            else:
                stream.send_velocity((random.choice([-1, 0, 1], 6) * velocity).tolist())
            arm.run(int(random.integers(5, 80)))
    speeds = arm.speeds()
    assert speeds.max() < 1.2 * 0.25
    assert np.quantile(speeds, 0.95) < 1.05 * 0.25


def test_a_jog_keeps_the_speed_and_stops_at_once(arm: Arm) -> None:
    arm.on()
    with arm.tool.group.stream(timeout_s=100.0) as stream:
        stream.send_velocity([2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        arm.run(300)
        stream.send_velocity([0.0] * 6)
        arm.run(100)
    speeds = arm.speeds()
    assert 0.24 < speeds.max() < HIGHEST
    assert speeds[360:].max() < 1e-6


@pytest.mark.parametrize("before", [0, 200])
@pytest.mark.parametrize("twist", [[0.5, 0, 0, 0, 0, 0], [0, 0.5, 0, 0, 1, 1]])
def test_a_twist_keeps_the_speed_and_its_direction(
    arm: Arm, before: int, twist: list[float]
) -> None:
    start = arm.tool.kinematics.forward(BENT)[:3, 3]
    if not before:
        arm.on()
    with arm.tool.stream(timeout_s=100.0) as stream:
        stream.send(twist)
        if before:
            arm.run(before)
            arm.on()
        arm.run(200)
        assert "links and tool move with at most 0.25 m/s" in stream.slow_reason
        stream.send([0.0] * 6)
        arm.run(300)
    speeds = arm.speeds()
    assert speeds[before + 50 * bool(before) :].max() < HIGHEST
    assert speeds[-1] < 1e-6
    displacement = arm.tool.kinematics.forward(arm.positions[-1])[:3, 3] - start
    along = np.array(twist[:3]) / np.linalg.norm(twist[:3])
    assert np.linalg.norm(displacement - (displacement @ along) * along) < 2e-5


def test_commands_of_single_axes_keep_the_speed_one_joint_at_a_time(arm: Arm) -> None:
    axes = arm.robot.axes
    arm.on()
    axes.move([Move(0, 1.0, FAST)])
    arm.run(10)
    with pytest.raises(NotReady, match="commands of single axes move one joint at a time"):
        axes.move([Move(1, 1.0, FAST)])
    arm.run(1500)
    assert arm.positions[-1][0] == pytest.approx(1.0)
    assert 0.24 < arm.speeds().max() < HIGHEST


def test_a_move_that_is_too_fast_is_stopped_when_it_is_switched_on(arm: Arm) -> None:
    axes = arm.robot.axes
    axes.move([Move(0, 3.0, FAST)])
    arm.run(150)
    arm.on()
    arm.run(250, lambda: arm.robot.image.operation[0] == Operation.IDLE)
    assert arm.positions[-1][0] < 1.5
    arm.run(100)
    assert arm.speeds()[-100:].max() < 1e-6
    for axis in range(6):
        axes.set_command_mode(axis, 1)
    axes.jog([Jog(0, Profile(-2.0, 10.0, 10.0))])
    arm.positions.clear()
    arm.run(200)
    assert 0.24 < arm.speeds().max() < HIGHEST


def test_it_is_shown_as_a_problem_that_does_not_prevent_motion(arm: Arm) -> None:
    assert arm.robot.find_problems() == []
    arm.on()
    (problem,) = arm.robot.find_problems()
    assert problem.kind is ProblemKind.REDUCED_SPEED
    assert not problem.prevents_motion
    assert problem.remedy == "For full speed: robotd tool reduced off"
    arm.reduced.set(False)
    assert arm.robot.find_problems() == []


def with_input(file: Path, name: str) -> Path:
    path = file.with_name(f"{name}.yaml")
    text = file.read_text(encoding="utf-8").replace("  tool: tip", f"  reduced_speed_input: {name}")
    path.write_text(text, encoding="utf-8")
    return path


def test_an_input_switches_it_on_where_it_is_0(file: Path) -> None:
    with open_robot(with_input(file, "full"), "sim", clock=SteppedClock()) as robot:
        reduced = robot.feature(reduced_speed)
        assert reduced.is_on
        robot.step(5)
        assert reduced.is_on
        (problem,) = robot.find_problems()
        assert problem.remedy == "The input full switches it on"
        robot.fault_injector.set_input_bit(0, 3, True)
        robot.step(5)
        assert not reduced.is_on
        reduced.set(True)
        robot.fault_injector.set_input_bit(0, 3, False)
        robot.step(5)
        reduced.set(False)
        assert reduced.is_on


def test_an_input_that_cannot_be_read_slows_down(file: Path) -> None:
    with open_robot(with_input(file, "full"), "sim", clock=SteppedClock()) as robot:
        reduced, driver = robot.feature(reduced_speed), robot.io._maybe_driver
        assert driver is not None
        read, failure = driver.read_inputs, OperationError("terminal EL1008 is gone")

        def fail(byte: int, length: int) -> bytes:
            raise failure

        robot.fault_injector.set_input_bit(0, 3, True)
        robot.step(5)
        assert not reduced.is_on
        driver.read_inputs = fail  # type: ignore[method-assign]
        robot.step(5)
        assert reduced.is_on
        (problem,) = robot.find_problems()
        assert problem.reason.endswith("input full cannot be read (terminal EL1008 is gone)")
        assert "Check the I/O module" in problem.remedy
        driver.read_inputs = read  # type: ignore[method-assign]
        robot.step(5)
        assert not reduced.is_on
        assert robot.find_problems() == []


def test_an_input_that_cannot_be_read_does_not_end_the_check_of_moves(file: Path) -> None:
    with open_robot(with_input(file, "full"), "sim", clock=SteppedClock()) as robot:
        robot.fault_injector.set_input_bit(0, 3, True)
        go(robot.feature(ToolGroups).only, BENT)
        robot.axes.move([Move(0, 3.0, FAST)])
        robot.step(150)
        driver = robot.io._maybe_driver
        assert driver is not None
        driver.read_inputs = lambda *_: b""  # type: ignore[method-assign]
        robot.step(250)
        assert robot.image.operation[0] == Operation.IDLE
        assert robot.image.position[0] < 1.5


def test_an_unknown_input_is_an_error(file: Path) -> None:
    unknown = r"tool_space.reduced_speed_input: .* unknown input 'ful'; did you mean 'full'"
    with pytest.raises(DescriptorError, match=unknown):
        build_robot(with_input(file, "ful"), "sim")
