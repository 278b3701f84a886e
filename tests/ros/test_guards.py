"""Guards of a robot's file over DDS: tests/features/doors has all of them in one process."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from std_msgs.msg import Bool
from tests.ros.robot_process import LATCHED, Client, RobotProcess, connected, stamp_s, wait_until
from tests.ros.test_tool_servo import ARM, NODES, READY, Hand, twist
from tests.ros.test_trajectory import goal
from wmx_ros2_message.srv import SetIoBit

from robotd_tool_space import Kinematics
from robotd_tool_space.streams.servo_status import ServoCode

pytestmark = pytest.mark.ros

SETTINGS = (
    NODES,
    "backends.sim.io_loopback=true",  # an output is the input that it leads to
    "inputs={teach: 0.3}",
    "tool_space.reduced_speed_input=teach",
    "tool_space.reduced_speed_level=1",
    "tool_space.collisions={links: false, margin_m: 0.02, planes: {floor: {normal: [0, 0, 1]}}}",
)
LOW = [0.3, 0.6, 1.6, -0.3, 1.2, 0.0]
SPEED_M_S = 0.5


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    options = [word for setting in SETTINGS for word in ("--set", setting)]
    with RobotProcess(*options, backend="sim", simulated_time=True) as process:
        process.wait_ready()
        with connected(process) as client:
            yield client


@pytest.fixture
def hand(client: Client) -> Iterator[Hand]:
    hand = Hand(client)
    try:
        hand.go_ready()
        yield hand
        hand.command = None
        hand.wait_at_rest()
    finally:
        hand.close()


def test_a_goal_through_the_floor_is_rejected(hand: Hand) -> None:
    before = hand.states[-1].position
    status, result = hand.client.send_goal(goal((3.0, [0.3, 1.1, *READY[2:]]))).result()
    assert status == GoalStatus.STATUS_ABORTED
    assert "and floor would" in result.error_string
    assert hand.states[-1].position == pytest.approx(before, abs=1e-6)


def test_a_twist_into_the_floor_stops_above_it(hand: Hand) -> None:
    hand.client.send_goal(goal((3.0, LOW))).result()
    hand.wait_at_rest()
    start_m = hand.pose[2, 3]
    hand.command = twist(0.0, 0.0, -SPEED_M_S)
    wait_until(lambda: hand.codes[-1].data == ServoCode.HALT_FOR_COLLISION, "the floor")
    wait_until(lambda: "floor" in hand.reasons[-1].data, "its name")
    wait_until(lambda: hand.speed < 1e-3, "rest")
    assert 0.03 < hand.pose[2, 3] < start_m - 0.02


def test_an_input_reduces_the_speed(hand: Hand) -> None:
    client, kinematics = hand.client, Kinematics.of_descriptor(ARM, "joints")
    reduced = client.listen(Bool, "/robotd/reduced_speed", LATCHED)

    def set_input(on: bool) -> None:
        answer = client.call(SetIoBit, "/wmx/io/set_output_bit", byte=0, bit=3, value=int(on))
        assert answer.success
        wait_until(lambda: reduced and reduced[-1].data is on, "the input")

    client.send_goal(goal((3.0, LOW))).result()
    highest = {}
    for on, joint1 in ((True, 1.5), (False, 0.3)):
        set_input(on)
        began = len(hand.states)
        status, result = client.send_goal(goal((1.0, [joint1, *LOW[1:]]))).result()
        assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
        states = hand.states[began:]
        places = kinematics.forward(np.array([state.position[:6] for state in states]))[:, :3, 3]
        distances = np.linalg.norm(np.diff(places, axis=0), axis=1)
        highest[on] = float((distances / np.diff([stamp_s(state) for state in states])).max())
    assert highest[True] < 0.27
    assert highest[False] > 0.35
