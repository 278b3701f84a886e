"""follow_joint_trajectory: reaches, cancels at standstill, preempts, refuses with a reason."""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointComponentTolerance, JointTolerance
from sensor_msgs.msg import JointState
from tests.ros.robot_process import BACKEND, Client, Goal, stamp_s, wait_until
from trajectory_msgs.msg import JointTrajectoryPoint, MultiDOFJointTrajectoryPoint

pytestmark = [pytest.mark.ros, pytest.mark.second_backend]

NAMES = [f"joint{number}" for number in range(1, 7)]
RESULT = FollowJointTrajectory.Result
FASTEST_RAD_S = 1.5  # the path's 1 rad/s, and the way back to it after a pause
NO_JUMP_RAD = 0.03  # a busy device's values are some milliseconds older than their stamps


@pytest.fixture(scope="module")
def joints(client: Client) -> list[Any]:
    return client.listen(JointState, "/joint_states")


def duration(seconds: float) -> Any:
    return Duration(sec=int(seconds), nanosec=round(seconds % 1 * 1e9))


def goal(*points: tuple[float, list[float]], names: list[str] | None = None) -> Any:
    """A goal of points (time, positions)."""
    message = FollowJointTrajectory.Goal()
    message.trajectory.joint_names = NAMES if names is None else names
    message.trajectory.points = [
        JointTrajectoryPoint(positions=positions, time_from_start=duration(time_s))
        for time_s, positions in points
    ]
    return message


def pose(joint1: float, joint2: float = 0.0) -> list[float]:
    return [joint1, joint2, 0.0, 0.0, 0.0, 0.0]


def position(joints: list[Any]) -> list[float]:
    return list(joints[-1].position[:6])


def speed(joints: list[Any]) -> float:
    return max(abs(value) for value in joints[-1].velocity[:6])


@pytest.fixture(autouse=True)
def at_zero(client: Client, joints: list[Any]) -> None:
    client.next(joints)
    if max(abs(value) for value in position(joints)) > 1e-3:
        status, result = client.send_goal(goal((1.5, pose(0.0)))).result()
        assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string


@pytest.mark.daily
def test_reaches_the_goal_with_feedback_on_the_way(client: Client, joints: list[Any]) -> None:
    feedback: list[Any] = []
    sent = client.send_goal(goal((1.0, pose(0.2, -0.1)), (2.0, pose(0.4, -0.2))), feedback)
    status, result = sent.result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    assert result.error_code == RESULT.SUCCESSFUL
    assert result.error_string
    client.next(joints)
    assert position(joints) == pytest.approx(pose(0.4, -0.2), abs=5e-3)
    assert len(feedback) >= 20
    middle = feedback[len(feedback) // 2]
    assert list(middle.joint_names) == NAMES
    assert 0.0 < middle.desired.positions[0] < 0.4
    assert middle.error.positions[0] == pytest.approx(
        middle.desired.positions[0] - middle.actual.positions[0]
    )
    times = [message.desired.time_from_start for message in feedback]
    assert [(t.sec, t.nanosec) for t in times] == sorted((t.sec, t.nanosec) for t in times)


def test_joints_may_come_in_any_order(client: Client, joints: list[Any]) -> None:
    sent = client.send_goal(goal((0.8, [0.0, 0.0, 0.0, 0.0, 0.1, 0.3]), names=NAMES[::-1]))
    status, result = sent.result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    client.next(joints)
    assert position(joints) == pytest.approx(pose(0.3, 0.1), abs=5e-3)


def test_a_goal_of_some_joints_leaves_the_others_where_they_are(
    client: Client, joints: list[Any]
) -> None:
    status, result = client.send_goal(goal((0.8, pose(0.2, 0.1)))).result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    status, result = client.send_goal(goal((0.8, [0.3]), names=["joint2"])).result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    client.next(joints)
    assert position(joints) == pytest.approx(pose(0.2, 0.3), abs=5e-3)


def test_the_joints_stand_until_a_first_point_at_their_position(
    client: Client, joints: list[Any]
) -> None:
    start = client.next(joints)
    here = list(start.position[:6])
    sent = client.send_goal(goal((1.0, here), (1.6, pose(0.3))))
    moved = client.next(joints, lambda message: abs(message.position[0] - here[0]) > 0.01)
    status, result = sent.result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    assert stamp_s(moved) - stamp_s(start) > 0.95


def test_velocities_of_some_points_are_ignored_and_the_result_says_so(client: Client) -> None:
    message = goal((0.5, pose(0.1)), (1.0, pose(0.2)))
    message.trajectory.points[1].velocities = [0.0] * 6
    status, result = client.send_goal(message).result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    assert "velocities are ignored: only 1 of 2 points have them" in result.error_string


def dense(start: list[float], end: list[float], seconds: float, step_s: float = 0.01) -> Any:
    """A smooth path at rest at both ends, with its first point at time 0."""
    times_s = np.append(np.arange(0.0, seconds - step_s / 2, step_s), seconds)
    share = (times_s / seconds)[:, None]
    displacement = np.subtract(end, start)
    message = goal(
        *zip(
            times_s.tolist(),
            (start + displacement * share**3 * (10 - 15 * share + 6 * share**2)).tolist(),
            strict=True,
        )
    )
    velocities = displacement * 30 * share**2 * (1 - share) ** 2 / seconds
    for point, row in zip(message.trajectory.points, velocities.tolist(), strict=True):
        point.velocities = row
    return message


@pytest.mark.parametrize("deviation", [0.0005, 0.009])
def test_a_small_start_deviation_is_blended_in(
    client: Client, joints: list[Any], deviation: float
) -> None:
    begin = len(joints)
    start = [place + deviation for place in position(joints)]
    status, result = client.send_goal(dense(start, pose(0.3), 1.2)).result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    assert "exceeds" not in result.error_string
    client.next(joints)
    assert position(joints) == pytest.approx(pose(0.3), abs=5e-3)
    fastest = max(max(map(abs, joint.velocity[:6])) for joint in joints[begin:])
    assert fastest < FASTEST_RAD_S


@pytest.mark.parametrize("rad_s", [0.3, 1.0])
def test_replanning_in_motion_with_a_first_point_at_time_zero(
    client: Client, joints: list[Any], rad_s: float
) -> None:
    """The client plans from the joint states, and its plan is 50 ms old when it is sent.

    On a busy computer it may be older: it is rejected, and the client plans again.
    """
    goals = [client.send_goal(dense(position(joints), pose(1.2), 1.875 * 1.2 / rad_s))]
    begin = len(joints)

    def replan(target: float) -> Goal | None:
        old = client.next(joints)
        client.next(joints, lambda message: stamp_s(message) > stamp_s(old) + 0.05)
        displacement = abs(target - old.position[0])
        plan = dense(list(old.position[:6]), pose(target), max(1.0, 1.875 * displacement / rad_s))
        sent = client.send_goal(plan)
        wait_until(lambda: goals[-1].done or sent.done, "the end of the goal before or of this one")
        return sent if goals[-1].done else None

    for target in (0.9, 1.3, 1.0):
        client.next(joints, lambda message: abs(message.velocity[0]) > 0.1 * rad_s)
        goals.append(wait_until(functools.partial(replan, target), "a plan that is accepted"))
    for replaced in goals[:-1]:
        assert "preempted" in replaced.result()[1].error_string
    status, result = goals[-1].result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    client.next(joints)
    assert position(joints) == pytest.approx(pose(1.0), abs=5e-3)
    fastest = max(max(map(abs, joint.velocity[:6])) for joint in joints[begin:])
    assert fastest < 1.5 * rad_s + 0.3


def test_a_goal_of_more_points_than_any_device_takes_is_followed(
    client: Client, joints: list[Any]
) -> None:
    sent = client.send_goal(dense(position(joints), pose(0.5), 2.4, step_s=0.002))
    status, result = sent.result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    client.next(joints)
    assert position(joints) == pytest.approx(pose(0.5), abs=5e-3)


def test_cancel_ends_at_standstill(client: Client, joints: list[Any]) -> None:
    sent = client.send_goal(goal((2.0, pose(1.5))))
    wait_until(lambda: speed(joints) > 0.5, "full swing")
    assert sent.cancel().goals_canceling
    status, _ = sent.result()
    assert status == GoalStatus.STATUS_CANCELED
    client.next(joints)
    assert speed(joints) < 0.02
    assert position(joints)[0] < 1.4


@pytest.mark.daily
def test_a_newer_goal_takes_over_without_a_stop(client: Client, joints: list[Any]) -> None:
    first = client.send_goal(goal((2.0, pose(1.0))))
    wait_until(lambda: speed(joints) > 0.3, "motion")
    start = len(joints)
    second = client.send_goal(goal((1.5, pose(0.8))))
    status, result = first.result()
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_code == RESULT.INVALID_GOAL
    assert "preempted" in result.error_string
    status, result = second.result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    client.next(joints)
    assert position(joints) == pytest.approx(pose(0.8), abs=5e-3)
    under_way = list(itertools.takewhile(lambda message: message.position[0] < 0.7, joints[start:]))
    if BACKEND == "sim":  # devices that join the points themselves stop in between
        assert min(message.velocity[0] for message in under_way) > 0.05
    for before, after in itertools.pairwise(joints[start:]):  # some may be lost
        step = abs(after.position[0] - before.position[0])
        assert step <= FASTEST_RAD_S * (stamp_s(after) - stamp_s(before)) + NO_JUMP_RAD


def with_tolerance(**tolerance: float | str) -> Any:
    message = goal((1.0, pose(0.2)))
    message.path_tolerance = [JointTolerance(**tolerance)]
    return message


def with_stamp(seconds: int) -> Any:
    message = goal((1.0, pose(0.1)))
    message.trajectory.header.stamp.sec = seconds
    return message


def with_component_tolerance() -> Any:
    message = goal((1.0, pose(0.2)))
    message.component_path_tolerance = [JointComponentTolerance(joint_name="joint1")]
    return message


def with_multi_dof() -> Any:
    message = goal((1.0, pose(0.2)))
    message.multi_dof_trajectory.points = [MultiDOFJointTrajectoryPoint()]
    return message


def with_effort() -> Any:
    message = goal((1.0, pose(0.2)))
    message.trajectory.points[0].effort = [1.0] * 6
    return message


def many_points(count: int) -> Any:
    return goal(*((0.01 * number, pose(0.0)) for number in range(count)))


@pytest.mark.parametrize(
    ("message", "code", "reason"),
    [
        (goal(), RESULT.INVALID_GOAL, "no points"),
        (goal((1.0, pose(0.1)), names=[]), RESULT.INVALID_JOINTS, "names no joints"),
        (goal((1.0, pose(0.1)), names=[*NAMES[:5], "arm"]), RESULT.INVALID_JOINTS, "'arm'"),
        (goal((1.0, [0.1] * 6), names=[*NAMES[:5], "joint1"]), RESULT.INVALID_JOINTS, "joint1"),
        (goal((1.0, [0.1] * 5)), RESULT.INVALID_GOAL, "5 positions for 6 joints"),
        (goal((1.0, pose(math.nan))), RESULT.INVALID_GOAL, "position is nan"),
        (goal((2.0, pose(0.1)), (1.0, pose(0.2))), RESULT.INVALID_GOAL, "not after"),
        (goal((9.0, pose(3.2))), RESULT.INVALID_GOAL, "joint1"),
        (goal((0.1, pose(2.0))), RESULT.INVALID_GOAL, "joint1"),
        (goal((0.0, pose(0.5)), (1.0, pose(0.6))), RESULT.INVALID_GOAL, "joint1"),
        (goal((0.3, pose(0.4))), RESULT.INVALID_GOAL, "joint1 at 0.000 s: acceleration"),
        (many_points(3001), RESULT.INVALID_GOAL, "3001 points exceed the limit of 3000"),
        (with_tolerance(name="wrist", position=0.1), RESULT.INVALID_JOINTS, "'wrist'"),
        (with_tolerance(name="joint1", position=-2.0), RESULT.INVALID_GOAL, "-2"),
        (with_stamp(1), RESULT.OLD_HEADER_TIMESTAMP, "over"),
        (with_component_tolerance(), RESULT.INVALID_GOAL, "component_path_tolerance"),
        (with_multi_dof(), RESULT.INVALID_GOAL, "multi_dof_trajectory"),
        (with_effort(), RESULT.INVALID_GOAL, "effort"),
    ],
)
def test_bad_goals_are_aborted_with_code_and_reason(
    client: Client, joints: list[Any], message: Any, code: int, reason: str
) -> None:
    status, result = client.send_goal(message).result()
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_code == code, result.error_string
    assert reason in result.error_string
    client.next(joints)
    assert speed(joints) < 0.01


def test_a_bad_goal_leaves_the_running_one_alone(client: Client) -> None:
    running = client.send_goal(goal((1.0, pose(0.3))))
    status, result = client.send_goal(goal((1.0, pose(9.0)))).result()
    assert status == GoalStatus.STATUS_ABORTED
    assert not running.done
    status, result = running.result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string


def test_path_tolerance_aborts_and_names_the_joint(client: Client, joints: list[Any]) -> None:
    message = goal((0.8, pose(1.0)))
    message.path_tolerance = [JointTolerance(name="joint1", position=1e-6)]
    status, result = client.send_goal(message).result()
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_code == RESULT.PATH_TOLERANCE_VIOLATED
    assert "joint1" in result.error_string
    client.next(joints)
    assert speed(joints) < 0.02


def test_a_future_stamp_waits_for_its_time_and_can_be_canceled(
    client: Client, joints: list[Any]
) -> None:
    message = goal((0.5, pose(0.2)))
    start = client.now_ns + 10**9
    message.trajectory.header.stamp.sec = start // 10**9
    message.trajectory.header.stamp.nanosec = start % 10**9
    status, result = client.send_goal(message).result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    assert stamp_s(joints[-1]) >= start * 1e-9 + 0.45
    message.trajectory.header.stamp.sec += 3600
    waiting = client.send_goal(message)
    waiting.cancel()
    assert waiting.result()[0] == GoalStatus.STATUS_CANCELED
