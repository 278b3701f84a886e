"""Arm and base on one device: each moves, starts and stops without the other noticing."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.descriptor import RobotDescriptor
from robotd.device.axes import Move
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.motion import TrajectoryRequest
from robotd.motion.profile import Profile
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

WHEELS = [1, 2]
WAIT_S = 20.0


@pytest.fixture
def robot() -> Iterator[Robot]:
    joint = {"name": "arm", "axis": 0, "lower_rad": -3.0, "upper_rad": 3.0,
             "velocity_rad_s": 3.0, "acceleration_rad_s2": 10.0}  # fmt: skip
    drive = {"left_axis": 1, "right_axis": 2, "wheel_radius_m": 0.1, "wheel_separation_m": 0.4,
             "velocity_m_s": 1.0, "acceleration_m_s2": 2.0, "deceleration_m_s2": 2.0,
             "angular_velocity_rad_s": 2.0, "angular_acceleration_rad_s2": 4.0,
             "angular_deceleration_rad_s2": 4.0}  # fmt: skip
    descriptor = RobotDescriptor.model_validate(
        {"schema": 1, "name": "rover", "joints": [joint], "drive": drive}
    )
    robot = Robot(descriptor, load_backend("sim"), SteppedClock())
    try:
        robot.start()
        yield robot
    finally:
        robot.shutdown()


def until(robot: Robot, condition: Callable[[], object]) -> None:
    """Step with the base commanded, until ``condition``."""
    assert robot.base is not None
    deadline = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < deadline
        robot.base.command(0.3, 0.0)
        robot.step(2)
        time.sleep(5e-4)  # for the threads that claim axes


def streams(robot: Robot, axis: int) -> bool:
    return bool(robot.image.operation[axis] == Operation.STREAM)


def ends(robot: Robot, execution: TrajectoryExecution) -> Outcome | None:
    until(robot, lambda: execution.done)
    return execution.outcome


def test_arm_and_base_move_at_the_same_time(robot: Robot) -> None:
    request = TrajectoryRequest.from_rows(["arm"], [2.0], [[1.0]])
    with robot.follower.follow(request) as execution:
        assert ends(robot, execution) is Outcome.SUCCEEDED, execution.message
    assert robot.base is not None
    assert robot.base.pose.x > 0.1


def test_an_arm_that_was_moved_by_hand_does_not_return_when_it_is_claimed(robot: Robot) -> None:
    request = TrajectoryRequest.from_rows(["arm"], [1.0], [[0.5]])
    with robot.follower.follow(request) as execution:
        ends(robot, execution)
    robot.axes.move([Move(0, -0.5, Profile(2.0, 8.0, 8.0))])
    until(robot, lambda: streams(robot, 1) and abs(robot.image.position[0] + 0.5) < 1e-3)
    until(robot, lambda: robot.image.operation[0] == Operation.IDLE)
    commands: list[float] = []

    def look(image: ProcessImage) -> None:
        commands.append(float(image.position_command[0]))

    robot.control_loop.every(robot.descriptor.cycle.rate_hz, "look", look)
    with robot.axes.claimed("test", [0]):
        until(robot, lambda: streams(robot, 0) and len(commands) > 50)
    steps = np.abs(np.diff(commands))
    assert steps.max(initial=0.0) < 1e-6, "claimed while the base streams, the arm moved"


def test_a_wheel_stops_beside_a_faulty_one_while_the_arm_moves(robot: Robot) -> None:
    """Its claim may end late: the lock of the axes waits for a slow driver."""
    request = TrajectoryRequest.from_rows(["arm"], [5.0], [[1.0]])
    with robot.follower.follow(request) as execution:
        until(robot, lambda: robot.image.velocity[1] > 2.0)
        with robot.axes._lock:
            robot.fault_injector.trip(2, 17)
            robot.step(200)
            assert robot.image.velocity[1] == pytest.approx(0.0, abs=1e-3)
            assert not execution.done
