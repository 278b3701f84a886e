"""``robotd run`` on the simulated controller: goal, stream and stop by ROS messages."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from tests.plugins.franka.controller import Controller, controller, needs_simulator
from tests.ros.robot_process import Client, RobotProcess, command_until, connected, wait_until
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robotd.api import NANOSECONDS

pytestmark = [needs_simulator, pytest.mark.ros, pytest.mark.long]

ACTION = "/fr3_arm_controller/follow_joint_trajectory"
NAMES = [f"fr3_joint{number}" for number in range(1, 8)]
STEP = np.array([0.2, 0.1, -0.1, 0.1, 0.2, -0.1, 0.2])


@pytest.fixture
def unit() -> Iterator[Controller]:
    with controller() as found:
        yield found


@pytest.fixture
def client(unit: Controller) -> Iterator[Client]:
    address = f"backends.franka.address={unit.address}"
    with RobotProcess("--set", address, robot="fr3", backend="franka") as process:
        process.wait_ready()
        with connected(process) as client:
            yield client


def to(position: np.ndarray, duration_s: float) -> FollowJointTrajectory.Goal:
    point = JointTrajectoryPoint(positions=position.tolist())
    point.time_from_start.sec, rest = divmod(round(duration_s * NANOSECONDS), NANOSECONDS)
    point.time_from_start.nanosec = rest
    return FollowJointTrajectory.Goal(
        trajectory=JointTrajectory(joint_names=NAMES, points=[point]),
        # On a busy computer the arm of the simulated controller is not at rest for long.
        goal_tolerance=[JointTolerance(name=name, velocity=0.1) for name in NAMES],
    )


def test_goal_stream_and_stop(client: Client, unit: Controller) -> None:
    states = client.listen(JointState, "/joint_states")
    state = client.next(states)
    assert list(state.name) == NAMES
    start = np.array(unit.command().position)
    assert list(state.position) == pytest.approx(list(start), abs=0.01)
    assert state.effort[1] == pytest.approx(unit.command().torque[1], abs=5.0)

    _, result = client.send_goal(to(start + STEP, 1.5), action=ACTION).result()
    assert result.error_code == 0, result.error_string
    assert unit.command().position == pytest.approx(start + STEP, abs=0.03)

    stream = client.publisher(Float64MultiArray, "/forward_position_controller/commands")
    message = Float64MultiArray(data=(start + 1.5 * STEP).tolist())

    def is_there() -> bool:
        return bool(np.abs(unit.command().position - start - 1.5 * STEP).max() < 0.03)

    command_until(lambda: stream.publish(message), is_there, "the end of the stream")

    goal = client.send_goal(to(start, 20.0), action=ACTION)
    there = np.array(unit.command().position)
    moved = lambda: np.abs(unit.command().position - there).max() > 0.005  # noqa: E731
    wait_until(moved, "motion")
    assert client.call(Trigger, "/robotd/stop").success
    _, result = goal.result()
    assert result.error_code != 0
    rest = np.array(unit.command().position)
    assert np.abs(rest - start).max() > 0.05  # it has not arrived
    assert client.call(Trigger, "/robotd/reset").success
    assert unit.command().position == pytest.approx(rest, abs=0.01)
