"""Stop input, part sensor and takeover over DDS, on a robot whose inputs show its outputs."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from action_msgs.msg import GoalStatus
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger
from tests.ros.robot_process import LATCHED, Client, RobotProcess, command_until, wait_until
from tests.ros.test_gripper_actions import CLOSED_M, command
from tests.ros.test_trajectory import goal, pose
from wmx_ros2_message.srv import SetIoBit

pytestmark = [pytest.mark.daily, pytest.mark.ros]

SETTINGS = (
    "backends.sim.io_loopback=true",
    "stop_input={input_byte: 0, input_bit: 3, motion_level: 0}",
    "gripper.part_sensor={input_byte: 0, input_bit: 5}",
    "gripper.travel_time_s=2.0",
    "stream.takeover=true",
    "stream.timeout_s=30.0",  # the stream goes on while the goal arrives
)


@pytest.fixture(scope="module")
def wired() -> Iterator[Client]:
    options = [word for setting in SETTINGS for word in ("--set", setting)]
    with RobotProcess(*options, backend="sim") as process:
        process.wait_output("ready after")
        client = Client(process.domain)
        yield client
        client.close()


def set_input(client: Client, bit: int, on: bool) -> None:
    assert client.call(SetIoBit, "/wmx/io/set_output_bit", byte=0, bit=bit, value=int(on)).success


def test_the_stop_input_ends_a_goal_and_has_to_be_released_before_the_reset(wired: Client) -> None:
    stopped = wired.listen(String, "/robotd/stopped", LATCHED)
    joints = wired.listen(JointState, "/joint_states")
    sent = wired.send_goal(goal((10.0, pose(1.0))))
    wired.next(joints, lambda message: message.position[0] > 0.02)
    set_input(wired, 3, on=True)
    status, result = sent.result()
    assert status == GoalStatus.STATUS_ABORTED
    assert "stop input 0.3" in result.error_string
    wait_until(lambda: stopped and "stop input 0.3" in stopped[-1].data, "the reason")
    answer = wired.call(Trigger, "/robotd/reset")
    assert not answer.success
    assert "stop input 0.3" in answer.message
    set_input(wired, 3, on=False)
    # The input follows the output in the next period.
    wait_until(lambda: wired.call(Trigger, "/robotd/reset").success, "the release to arrive")
    assert wired.send_goal(goal((1.5, pose(0.0)))).result()[0] == GoalStatus.STATUS_SUCCEEDED


def test_a_part_stalls_the_gripper(wired: Client) -> None:
    set_input(wired, 5, on=True)
    _, result = command(wired, CLOSED_M)
    assert result.stalled
    assert not result.reached_goal
    assert result.position < CLOSED_M
    set_input(wired, 5, on=False)
    assert command(wired, 0.0)[1].reached_goal


def test_a_goal_takes_over_from_a_stream_where_the_descriptor_allows_it(wired: Client) -> None:
    joints, owners = wired.listen(JointState, "/joint_states"), wired.listen_owners()
    topic = "forward_position_controller/commands"
    publisher = wired.publisher(Float64MultiArray, f"/{topic}")
    here, target = Float64MultiArray(data=pose(0.0)), Float64MultiArray(data=pose(0.8))
    command_until(
        lambda: publisher.publish(here),  # obeyed whatever was lost before it
        lambda: owners and owners[-1].get("joint1") == topic,
        "the stream to own the joints",
    )
    publisher.publish(target)
    wired.next(joints, lambda message: message.position[0] > 0.02)
    status, result = wired.send_goal(goal((2.0, pose(0.1)))).result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    wired.next(joints, lambda message: abs(message.position[0] - 0.1) < 2e-3)
