"""The arm on simulated CANopen drives, by ROS: start, goal, gripper, cancel, end in order."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from tests.ros.robot_process import Client, RobotProcess, wait_until
from trajectory_msgs.msg import JointTrajectoryPoint
from wmx_ros2_message.srv import EcatGetNetworkState, GetIoBit

pytestmark = pytest.mark.ros


@pytest.fixture
def arm() -> Iterator[RobotProcess]:
    with RobotProcess("--variant", "canopen_simulated", backend="canopen") as process:
        process.wait_ready()
        yield process


def goal(seconds: int, position: float) -> Any:
    message = FollowJointTrajectory.Goal()
    message.trajectory.joint_names = [f"joint{number}" for number in range(1, 7)]
    point = JointTrajectoryPoint(positions=[position] * 6, time_from_start=Duration(sec=seconds))
    message.trajectory.points = [point]
    return message


def test_the_arm_moves_grips_and_stops(arm: RobotProcess) -> None:
    client = Client(arm.domain)
    try:
        client.wait_engine()
        joints = client.listen(JointState, "/joint_states")
        status, result = client.send_goal(goal(1, 0.4)).result()
        assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
        assert client.next(joints).position[:6] == pytest.approx([0.4] * 6, abs=2e-3)

        assert client.call(SetBool, "/wmx/set_gripper", data=True).success
        assert client.call(GetIoBit, "/wmx/io/get_output_bit", byte=0, bit=0).value == 1

        sent = client.send_goal(goal(2, -0.8))
        wait_until(lambda: joints[-1].position[0] < 0.2, "motion")
        assert sent.cancel().goals_canceling
        assert sent.result()[0] == GoalStatus.STATUS_CANCELED
        stands = client.next(joints)
        assert max(map(abs, stands.velocity[:6])) < 0.02
        assert stands.position[0] > -0.7

        network = client.call(EcatGetNetworkState, "/wmx/ecat/get_network_state", master_id=0)
        assert network.num_of_slaves == 7
        assert "CANopen" in network.message
    finally:
        client.close()
    assert arm.end() == 0, arm.output
