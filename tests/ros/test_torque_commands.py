"""Torques of an arm on a topic, with CANopen drives of the robot's own process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from tests.ros.robot_process import LATCHED, Client, RobotProcess, command_until, wait_until

from robotd.control.groups.problem import ProblemKind
from robotd_ros.problem_messages import read_problems

pytestmark = pytest.mark.ros

ROBOT = Path(__file__).parents[1] / "plugins" / "canopen" / "bus" / "torque_drives.yaml"
TOPIC = "/forward_effort_controller/commands"
RATE_HZ = 50.0


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RobotProcess]:
    robot = tmp_path_factory.mktemp("robot") / "robot.yaml"
    robot.write_text(
        f"""extends: {ROBOT}
name: torque_arm
nodes: [wmx_engine_node, manipulator_state, joint_command_node]
ros_parameters:
  manipulator_state: {{encoder_joint_topic: joint_states}}
  joint_command_node: {{effort_commands_topic: {TOPIC[1:]}, command_timeout_s: 0.2}}
"""
    )
    with RobotProcess(robot=str(robot), backend="canopen", patient=False) as process:
        process.wait_ready()
        yield process
        assert process.end() == 0, process.output


def test_torques_move_the_joints_while_they_come(arm: RobotProcess) -> None:
    client = Client(arm.domain)
    states = client.listen(JointState, "/joint_states")
    owners = client.listen_owners()
    torques = client.publisher(Float64MultiArray, TOPIC)
    wait_until(lambda: states and torques.get_subscription_count(), "the arm")

    def moves() -> bool:
        has_moved = any(state.velocity[0] > 0.5 for state in states)
        return has_moved and any(TOPIC[1:] in found.values() for found in owners)

    command_until(
        lambda: torques.publish(Float64MultiArray(data=[6.0, 0.0])),
        moves,
        "a torque of 6 N·m moves the joint, which belongs to the topic",
        RATE_HZ,
    )
    wait_until(lambda: abs(states[-1].velocity[0]) < 1e-3, "without messages the joint stops")
    wait_until(lambda: TOPIC[1:] not in owners[-1].values(), "the joints belong to nobody")
    torques.publish(Float64MultiArray(data=[6.0]))
    wait_until(lambda: "torque: 1 values for 2 joints" in arm.output, "the rejection is logged")
    client.close()


def sources(message: DiagnosticArray) -> list[str]:
    found = read_problems(message)
    return [problem.reason for problem in found if problem.kind is ProblemKind.SOURCE]


def test_a_client_that_commands_on_through_a_stop_moves_nothing_until_it_begins_anew(
    arm: RobotProcess,
) -> None:
    client = Client(arm.domain)
    states = client.listen(JointState, "/joint_states", 100)
    torques = client.publisher(Float64MultiArray, TOPIC)
    problems = client.listen(DiagnosticArray, "/robotd/problems", LATCHED)
    wait_until(lambda: states and problems, "the arm")

    def publish(torque: float) -> None:
        torques.publish(Float64MultiArray(data=[torque, 0.0]))
        time.sleep(1.0 / RATE_HZ)

    def command(condition: Callable[[], Any], what: str) -> None:
        def attempt() -> Any:
            publish(6.0)
            return condition()

        wait_until(attempt, what)

    command(lambda: states[-1].velocity[0] > 0.5, "motion")
    assert client.call(Trigger, "/robotd/stop").success
    command(lambda: abs(states[-1].velocity[0]) < 1e-3, "standstill")
    assert client.call(Trigger, "/robotd/reset").success
    command(lambda: sources(problems[-1]), "the problem")
    assert sources(problems[-1])[0].startswith("forward_effort_controller")
    start, first = states[-1].position[0], len(states)
    command(lambda: len(states) > first + 25, "half a second")
    publish(0.0)  # arms the source, and is not applied: an arm would fall
    wait_until(lambda: not sources(problems[-1]), "no problem")
    assert states[-1].position[0] == pytest.approx(start, abs=1e-3)
    command(lambda: states[-1].velocity[0] > 0.5, "motion anew")
    wait_until(lambda: abs(states[-1].velocity[0]) < 1e-3, "standstill")
    client.close()
