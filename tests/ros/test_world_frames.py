"""Work frames from /tf over DDS, published by another process: where they are, and followed."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, TransformStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from robotd_msgs.action import MoveTool
from robotd_msgs.srv import ComputeFk, SelectFrame
from std_msgs.msg import String
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import Client, RobotProcess, connected, wait_for, wait_until
from tests.ros.test_client_commands import robotd
from tests.ros.test_tool_servo import ARM, Hand, twist
from tf2_msgs.msg import TFMessage

from robotd_ros.nodes.tool_pose_topic import fill_transform

pytestmark = [pytest.mark.ros, pytest.mark.long]

PREFIX = "cell/"
BASE = f"{PREFIX}base_link"
NODES = f"nodes=[{','.join(ARM.nodes)},servo_node,robot_state_publisher]"
STATIC = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def transform(parent: str, child: str, x: float = 0.0, y: float = 0.0) -> TransformStamped:
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = parent
    fill_transform(message, np.array([x, y, 0.0, 0.0, 0.0, 0.0, 1.0]))
    return message


class Belt:
    """Publishes ``world`` below the base of the arm, once, and a ``belt`` in it at 50 Hz."""

    def __init__(self, client: Client) -> None:
        self.rest()
        self._client = client
        self._publisher = client.node.create_publisher(TFMessage, "/tf", 100)
        static = client.node.create_publisher(TFMessage, "/tf_static", STATIC)
        static.publish(TFMessage(transforms=[transform("world", BASE, x=-1.0)]))
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def rest(self) -> None:
        self.y_m, self.speed_m_s, self.heard = 0.0, 0.0, True

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        before_ns = self._client.now_ns
        while not self._closing.wait(0.02):
            now_ns = self._client.now_ns
            self.y_m += (now_ns - before_ns) * 1e-9 * self.speed_m_s
            before_ns = now_ns
            if self.heard and now_ns:
                message = transform("world", "belt", y=self.y_m)
                message.header.stamp.sec, message.header.stamp.nanosec = divmod(now_ns, 10**9)
                self._publisher.publish(TFMessage(transforms=[message]))


@pytest.fixture(scope="module")
def arm() -> Iterator[RobotProcess]:
    # Slower than real time: a busy computer must not make transforms older than the limit.
    ros = ("--time-scale", "0.4", "--set", NODES, "--ros-args", "-p", f"frame_prefix:={PREFIX}")
    with RobotProcess(*ros, backend="sim", simulated_time=True) as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def client(arm: RobotProcess) -> Iterator[Client]:
    with connected(arm) as client:
        yield client


@pytest.fixture(scope="module")
def belt(client: Client) -> Iterator[Belt]:
    belt = Belt(client)
    yield belt
    belt.close()


@pytest.fixture
def hand(client: Client, belt: Belt) -> Iterator[Hand]:
    belt.rest()
    hand = Hand(client)
    hand.go_ready()
    yield hand
    hand.command = None
    hand.wait_at_rest()
    hand.close()
    assert select(client, "").success


def select(client: Client, name: str) -> Any:
    return client.call(SelectFrame, "/robotd/set_work_frame", name=name)


def pose(client: Client) -> Any:
    return client.call(ComputeFk, "/robotd/compute_fk")


def place(client: Client) -> list[float]:
    answer = pose(client)
    assert answer.success, answer.message
    point = answer.pose_stamped.pose.position
    return [point.x, point.y, point.z]


def plan_up(client: Client) -> Any:
    action = GoalClient(client.node, MoveTool, "/robotd/move_tool")
    wait_until(action.server_is_ready, "no action")
    up = Pose(position=Point(z=0.02))
    goal = MoveTool.Goal(frame=MoveTool.Goal.RELATIVE_BASE, poses=[up], line=True, plan_only=True)
    return wait_for(wait_for(action.send_goal_async(goal)).get_result_async())


def test_a_frame_of_the_world_is_where_it_was_at_the_choice(
    arm: RobotProcess, client: Client, belt: Belt, hand: Hand
) -> None:
    bare = place(client)
    belt.y_m = 0.25
    wait_until(lambda: select(client, "tf:belt").success, "the frame")
    # The belt is 1 m before the base, along x.
    expected = [bare[0] - 1.0, bare[1] - 0.25, bare[2]]
    assert place(client) == pytest.approx(expected, abs=1e-6)
    assert pose(client).pose_stamped.header.frame_id == "tf:belt"
    belt.y_m = 0.5
    assert plan_up(client).status == GoalStatus.STATUS_SUCCEEDED
    assert place(client) == pytest.approx(expected, abs=1e-6)
    status, output, error = robotd(arm.domain, "tool", "frame", "tf:belt")
    assert (status, output.splitlines()[-1]) == (0, "work frame tf:belt"), error
    assert place(client)[1] == pytest.approx(bare[1] - 0.5, abs=1e-6)


def test_a_frame_that_nobody_publishes_is_named_with_those_that_are(
    client: Client, hand: Hand
) -> None:
    answer = select(client, "tf:belts")
    assert not answer.success
    assert answer.message.startswith(
        "no transform of frame 'belts'; did you mean 'belt'? (received: belt, cell/"
    )
    assert answer.message.endswith("world), after 3 s")


def test_the_tool_follows_a_frame_that_moves_while_it_is_commanded(
    client: Client, belt: Belt, hand: Hand
) -> None:
    assert select(client, "follow:belt").success
    rejected = plan_up(client)
    assert rejected.status == GoalStatus.STATUS_ABORTED
    assert "'follow:belt' moves, and only streams of the tool follow it" in rejected.result.message
    start = hand.pose[1, 3]
    belt.speed_m_s = -0.04
    assert hand.speed < 1e-3  # a frame alone moves nothing
    hand.command = twist(0.0, 0.0, 0.0, frame="follow:belt")
    wait_until(lambda: start - hand.pose[1, 3] > 0.01, "the tool is on its way")

    def keeps_its_place() -> bool:
        """While the belt moves by 4 cm; the rest is the time between two calls and messages."""
        before, began_m = place(client), belt.y_m
        wait_until(lambda: belt.y_m < began_m - 0.04, "4 cm of the belt")
        return place(client) == pytest.approx(before, abs=0.015)

    # On a busy computer commands come late, and are dropped.
    wait_until(keeps_its_place, "4 cm in which the tool is at rest in the frame")
    hand.command = None
    hand.wait_at_rest()


def test_a_frame_that_is_lost_stops_the_tool_until_it_is_chosen_again(
    client: Client, belt: Belt, hand: Hand
) -> None:
    reasons = client.listen(String, "/servo_node/status_message")
    assert select(client, "follow:belt").success
    start = hand.pose[1, 3]
    belt.speed_m_s = -0.04
    hand.command = twist(0.0, 0.0, 0.0, frame="follow:belt")
    wait_until(lambda: start - hand.pose[1, 3] > 0.01, "the tool is on its way")
    belt.heard = False
    wait_until(lambda: reasons and "its transforms are" in reasons[-1].data, "the reason")
    hand.wait_at_rest()
    belt.heard, belt.speed_m_s = True, 0.0
    assert "choose the work frame again" in pose(client).message
    # A client that commands in the frame while it is chosen has to begin anew, however long it did.
    until_ns = client.now_ns + 10**9
    wait_until(lambda: client.now_ns > until_ns, "a second")
    wait_until(lambda: select(client, "follow:belt").success, "the frame is chosen again")
    wait_until(lambda: hand.waiting, "the client has to be released")
    assert hand.speed < 1e-3
    hand.command = None
    wait_until(lambda: not hand.waiting, "the client was silent")
    start = hand.pose[1, 3]
    belt.speed_m_s = -0.04
    hand.command = twist(0.0, 0.0, 0.0, frame="follow:belt")
    wait_until(lambda: start - hand.pose[1, 3] > 0.01, "the tool is on its way again")


def test_what_the_arm_carries_is_not_followed(client: Client, hand: Hand) -> None:
    answer = select(client, f"follow:{PREFIX}link6")
    assert not answer.success
    assert "the arm itself moves it, with cell/link" in answer.message
    assert select(client, f"tf:{PREFIX}link6").success
    assert place(client) == pytest.approx([0.0, 0.0, 0.0], abs=2e-3)
