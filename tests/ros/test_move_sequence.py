"""Sequences over ROS: one goal of many segments, its waits, its cancellation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose
from robotd_msgs.action import MoveSequence
from robotd_msgs.msg import MotionSegment, PathOutput
from robotd_msgs.srv import AppendSegments, ComputeFk
from sensor_msgs.msg import JointState
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import Client, RobotProcess, connected, wait_for, wait_until
from tests.ros.test_trajectory import goal
from wmx_ros2_message.srv import GetIoBit, SetIoBit

pytestmark = pytest.mark.ros

BENT = [0.0, 0.3, 1.4, -0.2, 1.2, 0.0]
LOOPBACK = "backends.sim.io_loopback=true"  # an output is the input that it leads to
INPUT = {"input_byte": 0, "input_bit": 3}


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with RobotProcess("--set", LOOPBACK, simulated_time=True) as process:
        process.wait_ready()
        with connected(process) as client:
            yield client


@pytest.fixture(autouse=True)
def bent(client: Client) -> None:
    assert client.send_goal(goal((3.0, BENT))).result()[0] == GoalStatus.STATUS_SUCCEEDED


@pytest.fixture(scope="module")
def action(client: Client) -> GoalClient:
    action = GoalClient(client.node, MoveSequence, "/robotd/move_sequence")
    wait_until(action.server_is_ready, "no action")
    return action


def test_a_force_that_the_backend_does_not_have_is_named(
    client: Client, action: GoalClient
) -> None:
    line = MotionSegment(kind=MotionSegment.LINE, poses=[pose(client)], until_force_n=10.0)
    answer = wait_for(
        wait_for(action.send_goal_async(MoveSequence.Goal(segments=[line]))).get_result_async()
    )
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert "the force at a tool" in answer.result.message


def pose(client: Client) -> Pose:
    """Where the tool is, measured."""
    return client.call(ComputeFk, "/robotd/compute_fk").pose_stamped.pose


def bent_pose(client: Client) -> Pose:
    names = [f"joint{number}" for number in range(1, 7)]
    state = JointState(name=names, position=BENT)
    return client.call(ComputeFk, "/robotd/compute_fk", joint_state=state).pose_stamped.pose


def beside(origin: Pose, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Pose:
    place = origin.position
    return Pose(
        position=Point(x=place.x + x, y=place.y + y, z=place.z + z), orientation=origin.orientation
    )


def set_input(client: Client, value: int) -> None:
    assert client.call(SetIoBit, "/wmx/io/set_output_bit", byte=0, bit=3, value=value).success


def line(to: Pose, **fields: Any) -> MotionSegment:
    return MotionSegment(kind=MotionSegment.LINE, poses=[to], **fields)


def send(action: GoalClient, *segments: MotionSegment, **fields: Any) -> tuple[Any, list[Any]]:
    """Handle and feedback of a goal."""
    feedback: list[Any] = []
    message = MoveSequence.Goal(segments=list(segments), **fields)
    handle = wait_for(
        action.send_goal_async(message, lambda message: feedback.append(message.feedback))
    )
    assert handle.accepted
    return handle, feedback


def ended(handle: Any) -> tuple[int, Any]:
    answer = wait_for(handle.get_result_async())
    return answer.status, answer.result


def distance(first: Pose, second: Pose) -> float:
    a, b = first.position, second.position
    return float(((a.x - b.x) ** 2 + (a.y - b.y) ** 2 + (a.z - b.z) ** 2) ** 0.5)


def test_segments_of_all_kinds_are_one_motion(client: Client, action: GoalClient) -> None:
    at = bent_pose(client)
    output = PathOutput(byte=0, bit=5, on=True)
    handle, feedback = send(
        action,
        line(beside(at, y=0.1), blend_m=0.02, outputs=[output]),
        MotionSegment(
            kind=MotionSegment.ARC,
            poses=[beside(at, y=0.15, z=-0.05), beside(at, y=0.1, z=-0.1)],
            blend_m=0.01,
            speed=0.5,
        ),
        MotionSegment(
            kind=MotionSegment.SPLINE, poses=[beside(at, y=0.05, z=-0.12), beside(at, z=-0.08)]
        ),
        MotionSegment(
            kind=MotionSegment.ARC_ABOUT,
            poses=[beside(at, z=-0.06)],
            angle=1.0,
            fixed_orientation=True,
            speed=0.3,
        ),
        MotionSegment(kind=MotionSegment.JOINTS, positions=BENT),
    )
    status, result = ended(handle)
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True), result.message
    assert (result.segment, list(result.notes)) == (5, [])
    assert distance(pose(client), at) < 1e-3
    numbers = [message.segment for message in feedback]
    assert numbers == sorted(numbers)
    assert {1, 2, 3, 4, 5} >= set(numbers) >= {1, 5}
    assert {message.segments for message in feedback} == {5}
    parts = [message.progress for message in feedback]
    assert parts == sorted(parts)
    assert client.call(GetIoBit, "/wmx/io/get_output_bit", byte=0, bit=5).value == 1


def test_a_rejected_sequence_names_the_segment_and_moves_nothing(
    client: Client, action: GoalClient
) -> None:
    at, before = bent_pose(client), pose(client)

    def rejection(*segments: MotionSegment, **fields: Any) -> str:
        status, result = ended(send(action, *segments, **fields)[0])
        assert (status, result.segment) == (GoalStatus.STATUS_ABORTED, 0)
        return str(result.message)

    up = line(beside(at, z=0.02))
    far = rejection(up, line(beside(at, z=0.6)))
    assert far.startswith("segment 2, line: at ")
    assert "segment 2: 2 poses: this kind of segment has 1" in rejection(
        up, MotionSegment(kind=MotionSegment.LINE, poses=[at, at])
    )
    assert rejection(up, line(at, speed=3.0)).endswith("speed is 3, must be 0.01 to 1")
    assert rejection(up, MotionSegment(kind=9)) == "segment 2: kind is 9, must be 0 to 5"
    wait = MotionSegment(kind=MotionSegment.WAIT, input_byte=9999)
    assert rejection(up, wait, up).startswith("segment 2, wait: ")
    # Behind a wait, and planned before anything moves.
    wait = MotionSegment(kind=MotionSegment.WAIT, time_s=1.0)
    assert rejection(up, wait, line(beside(at, z=0.6))).startswith("segment 3, line: at ")
    assert rejection() == "a sequence needs a segment"
    assert distance(pose(client), before) < 1e-6
    handle, _ = send(action, up, plan_only=True)
    status, result = ended(handle)
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True)
    assert "nothing moved" in result.message
    assert distance(pose(client), before) < 1e-6


def test_a_canceled_sequence_stops_on_its_path(client: Client, action: GoalClient) -> None:
    at = bent_pose(client)
    handle, feedback = send(action, line(beside(at, y=0.2), speed=0.2), line(at))
    wait_until(lambda: feedback and feedback[-1].progress > 0.1, "it moves")
    wait_for(handle.cancel_goal_async())
    status, result = ended(handle)
    assert (status, result.segment) == (GoalStatus.STATUS_CANCELED, 1), result.message
    here = pose(client).position
    assert 0.0 < here.y - at.position.y < 0.2
    assert here.x == pytest.approx(at.position.x, abs=1e-4)
    assert here.z == pytest.approx(at.position.z, abs=1e-4)


def test_a_sequence_waits_for_an_input(client: Client, action: GoalClient) -> None:
    at = bent_pose(client)
    wait = MotionSegment(kind=MotionSegment.WAIT, level=True, **INPUT)
    there = beside(at, y=0.05)
    handle, feedback = send(action, line(there, blend_m=0.01), wait, line(at))
    wait_until(lambda: feedback and feedback[-1].waiting, "it waits")
    assert feedback[-1].segment == 2
    assert distance(pose(client), there) < 1e-3
    set_input(client, 1)
    status, result = ended(handle)
    set_input(client, 0)
    assert (status, result.segment) == (GoalStatus.STATUS_SUCCEEDED, 3), result.message
    assert distance(pose(client), at) < 1e-3


def test_a_wait_ends_by_its_time_out_and_by_a_cancel(client: Client, action: GoalClient) -> None:
    at = bent_pose(client)
    there = beside(at, y=0.02)
    wait = MotionSegment(kind=MotionSegment.WAIT, level=True, timeout_s=0.3, **INPUT)
    status, result = ended(send(action, line(there), wait, line(at))[0])
    assert (status, result.segment) == (GoalStatus.STATUS_ABORTED, 2)
    assert result.message == "segment 2, wait: input 0.3 is not on after 0.3 s"
    assert distance(pose(client), there) < 1e-3
    handle, feedback = send(action, MotionSegment(kind=MotionSegment.WAIT, time_s=3600.0), line(at))
    wait_until(lambda: feedback and feedback[-1].waiting, "it waits")
    wait_for(handle.cancel_goal_async())
    status, result = ended(handle)
    assert (status, result.segment) == (GoalStatus.STATUS_CANCELED, 1)
    assert distance(pose(client), there) < 1e-3


def test_whoever_moves_the_arm_during_a_wait_ends_the_sequence(
    client: Client, action: GoalClient
) -> None:
    at = bent_pose(client)
    wait = MotionSegment(kind=MotionSegment.WAIT, level=True, **INPUT)
    handle, feedback = send(action, line(beside(at, y=0.02)), wait, line(at))
    wait_until(lambda: feedback and feedback[-1].waiting, "it waits")
    assert client.send_goal(goal((3.0, [0.0] * 6))).result()[0] == GoalStatus.STATUS_SUCCEEDED
    set_input(client, 1)
    status, result = ended(handle)
    set_input(client, 0)
    assert (status, result.segment) == (GoalStatus.STATUS_ABORTED, 3)
    assert result.message.startswith("ended before segment 3: ")


def test_segments_are_appended_to_the_goal_under_way(client: Client, action: GoalClient) -> None:
    at = bent_pose(client)
    rejected = client.call(AppendSegments, "/robotd/append_segments", segments=[line(at)])
    assert rejected.message.startswith("no goal of move_sequence runs")
    corner, end = beside(at, y=0.2), beside(at, y=0.2, z=-0.05)
    handle, feedback = send(action, line(corner, speed=0.1, blend_m=0.01))
    wait_until(lambda: feedback and feedback[-1].progress > 0.02, "it moves")
    far = client.call(AppendSegments, "/robotd/append_segments", segments=[line(beside(at, z=0.6))])
    assert not far.success
    assert far.message.startswith("segment 2, line: at "), far.message
    answer = client.call(AppendSegments, "/robotd/append_segments", segments=[line(end)])
    assert (answer.success, answer.joined) == (True, True), answer.message
    status, result = ended(handle)
    assert (status, result.segment) == (GoalStatus.STATUS_SUCCEEDED, 2), result.message
    assert distance(pose(client), end) < 1e-3
