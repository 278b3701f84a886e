"""manipulator_state: names, rate, fingers, mirrors and the clock of the stamps."""

from __future__ import annotations

import itertools
import math
import statistics

import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool
from tests.ros.robot_process import Client, RobotProcess, stamp_s, wait_until

pytestmark = [pytest.mark.daily, pytest.mark.ros]

NAMES = [f"joint{number}" for number in range(1, 7)] + ["picker_1_joint", "picker_2_joint"]


def test_names_and_numbers(client: Client) -> None:
    state = client.next(client.listen(JointState, "/joint_states"))
    assert list(state.name) == NAMES
    assert len(state.position) == len(state.velocity) == len(state.effort) == len(NAMES)
    assert all(math.isfinite(value) for value in (*state.position, *state.velocity))


def test_rate_is_the_parameter_s(client: Client) -> None:
    messages = client.listen(JointState, "/joint_states")
    client.next(messages)
    start = len(messages)
    wait_until(lambda: len(messages) > start + 1000, "1000 messages")
    times_s = [stamp_s(message) for message in messages[start : start + 1000]]
    # The median, not the mean: a busy computer misses periods.
    apart_s = statistics.median(later - earlier for earlier, later in itertools.pairwise(times_s))
    assert apart_s == pytest.approx(1 / 500, rel=0.2)


def test_gripper_moves_the_fingers(client: Client) -> None:
    messages = client.listen(JointState, "/joint_states")
    bare = client.listen(Float64MultiArray, "/gazebo_position_controller/commands")
    for closed, position in ((True, 0.045), (False, 0.0)):
        assert client.call(SetBool, "/wmx/set_gripper", data=closed).success
        state = client.next(messages, lambda message, p=position: message.position[6] == p)
        assert list(state.position[6:]) == [position, position]
        copy = client.next(bare, lambda message, p=position: message.data[6] == p)
        assert len(copy.data) == len(NAMES)


def test_deployment_of_isaac_sim_mirrors_without_a_stamp() -> None:
    with RobotProcess("--variant", "orin", "--nodes", "manipulator_state") as process:
        process.wait_ready()
        client = Client(process.domain)
        try:
            mirror = client.next(client.listen(JointState, "/isaacsim/joint_command"))
            assert (mirror.header.stamp.sec, mirror.header.stamp.nanosec) == (0, 0)
            assert list(mirror.name) == NAMES
            assert len(mirror.effort) == 0
            assert client.node.count_publishers("/gazebo_position_controller/commands") == 0
        finally:
            client.close()


def test_simulated_time_is_the_stamp() -> None:
    with RobotProcess(
        "--nodes", "manipulator_state", "--ros-args", "-p", "use_sim_time:=true"
    ) as process:
        process.wait_ready()
        client = Client(process.domain)
        try:
            messages = client.listen(JointState, "/joint_states")
            assert stamp_s(client.next(messages)) == 0.0
            clock = client.publisher(Clock, "/clock")
            message = Clock()
            message.clock.sec = 1234

            def shown() -> bool:
                clock.publish(message)  # best effort: one may come before the two have met
                return stamp_s(messages[-1]) == 1234.0

            wait_until(shown, "simulated time in the stamps")
        finally:
            client.close()
