"""Goals that are answered before they are converted."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from rclpy.action import CancelResponse, GoalResponse
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import WAIT_S, wait_for, wait_until
from trajectory_msgs.msg import JointTrajectoryPoint
from unique_identifier_msgs.msg import UUID

from robotd.clock import NANOSECONDS
from robotd_ros.host import RosHost
from robotd_ros.middleware import worker_action_server
from robotd_ros.middleware.rcl_error import RCLError
from robotd_testing.domain import own_domain

pytestmark = [pytest.mark.daily, pytest.mark.ros]

NAME = "follow"


class Server:
    """Action server that keeps what its callbacks get.

    Attributes:
        answer: to each goal.
        requests, goals: of the goal callback, and of accepted goals.
    """

    def __init__(self, host: RosHost) -> None:
        self.answer = GoalResponse.ACCEPT
        self.requests: list[Any] = []
        self.goals: list[Any] = []
        self.converted: list[bool] = []
        node = rclpy.create_node("server", context=host.context)
        self.action = worker_action_server(
            node,
            FollowJointTrajectory,
            NAME,
            admit=self._admit,
            accepted=self._accepted,
            cancel=lambda goal: CancelResponse.ACCEPT,
        )
        host.add_node(node)

    def _admit(self, request: Any) -> GoalResponse:
        self.requests.append(request)
        return self.answer

    def _accepted(self, goal: Any) -> None:
        self.converted.append("goal" in vars(self.requests[-1]))
        self.goals.append(goal)


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Server, GoalClient]]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with (
        own_domain() as domain,
        RosHost(domain_id=domain) as serving,
        RosHost(domain_id=domain) as asking,
    ):
        server = Server(serving)
        node = rclpy.create_node("client", context=asking.context)
        client = GoalClient(node, FollowJointTrajectory, NAME)
        asking.add_node(node)
        assert client.wait_for_server(WAIT_S)
        yield server, client


def goal_of(points: int) -> Any:
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = ["joint1", "joint2"]
    goal.trajectory.points = [
        JointTrajectoryPoint(positions=[float(number), 0.5]) for number in range(points)
    ]
    return goal


def test_a_goal_is_accepted_before_it_is_converted(ends: tuple[Server, GoalClient]) -> None:
    server, client = ends
    sent = goal_of(20)
    sent_ns = time.time_ns()
    handle = wait_for(client.send_goal_async(sent))
    assert handle.accepted
    wait_until(lambda: server.goals, "the accepted goal")
    assert server.converted == [False]
    goal = server.goals[0]
    assert bytes(goal.goal_id.uuid) == bytes(handle.goal_id.uuid)
    assert goal.request == sent
    assert goal.request is goal.request
    assert goal.requester.sequence_number == 1
    stamp_ns = handle.stamp.sec * NANOSECONDS + handle.stamp.nanosec
    assert sent_ns < stamp_ns < time.time_ns()


def test_a_rejected_goal_is_answered_and_freed(ends: tuple[Server, GoalClient]) -> None:
    server, client = ends
    server.answer = GoalResponse.REJECT
    assert not wait_for(client.send_goal_async(goal_of(1))).accepted
    assert not server.goals
    freed: list[int] = []
    server.requests[0]._functions = SimpleNamespace(destroy=freed.append)
    server.requests.clear()
    gc.collect()
    assert len(freed) == 1


def test_a_goal_id_that_is_known_is_rejected(ends: tuple[Server, GoalClient]) -> None:
    server, client = ends
    identity = UUID(uuid=range(16))
    assert wait_for(client.send_goal_async(goal_of(1), goal_uuid=identity)).accepted
    assert not wait_for(client.send_goal_async(goal_of(1), goal_uuid=identity)).accepted
    wait_until(lambda: server.goals, "the accepted goal")  # handed on after its answer
    assert len(server.goals) == 1


def test_the_message_is_freed_once_it_is_converted(ends: tuple[Server, GoalClient]) -> None:
    server, client = ends
    wait_for(client.send_goal_async(goal_of(2)))
    wait_until(lambda: server.goals, "the accepted goal")
    assert len(server.goals[0].request.trajectory.points) == 2
    assert server.requests[0]._message is None


def test_goals_of_a_burst_are_all_answered(ends: tuple[Server, GoalClient]) -> None:
    server, client = ends
    answers = [client.send_goal_async(goal_of(number)) for number in range(8)]
    assert all(wait_for(answer).accepted for answer in answers)
    wait_until(lambda: len(server.goals) == len(answers), "all goals")
    lengths = [len(goal.request.trajectory.points) for goal in server.goals]
    assert sorted(lengths) == list(range(8))


def test_a_goal_that_cannot_be_answered_ends(
    ends: tuple[Server, GoalClient], monkeypatch: pytest.MonkeyPatch
) -> None:
    server, client = ends

    def answer(*_: object) -> None:
        raise RCLError("client will not receive response")

    with monkeypatch.context() as unanswered:
        unanswered.setattr(server.action._requests, "answer", answer)
        client.send_goal_async(goal_of(1))
        wait_until(lambda: server.action._goal_handles, "the goal")
        (goal,) = server.action._goal_handles.values()
        wait_until(lambda: goal.status == GoalStatus.STATUS_ABORTED, "its end")
    assert wait_for(client.send_goal_async(goal_of(1))).accepted
    wait_until(lambda: server.goals, "the accepted goal")
    assert len(server.goals) == 1
