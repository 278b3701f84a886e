"""Node robotd: the operator's stop, reset and recovery, by services, topics and commands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from robotd_msgs.msg import RecoveryReport
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty, Float64, String
from std_srvs.srv import Trigger
from tests.ros.robot_process import LATCHED, Client, RobotProcess, wait_until
from tests.ros.test_client_commands import robotd
from tests.ros.test_trajectory import goal, pose, position
from wmx_ros2_message.msg import AxisPose

from robotd_ros.operator_messages import RECOVERY

pytestmark = [pytest.mark.ros, pytest.mark.second_backend]

BY_SERVICE = "by a client of the stop service"
BY_MESSAGE = "by a message on the stop topic"


@pytest.fixture(scope="module")
def joints(client: Client) -> list[Any]:
    return client.listen(JointState, "/joint_states")


@pytest.fixture(scope="module")
def stopped(client: Client) -> list[Any]:
    messages = client.listen(String, "/robotd/stopped", LATCHED)
    wait_until(lambda: messages, "the latched message")
    return messages


@pytest.fixture(autouse=True)
def allowed_at_zero(client: Client) -> Iterator[None]:
    yield
    client.publisher(Float64, "/robotd/set_speed").publish(Float64(data=1.0))
    for service in ("reset", "resume"):
        assert client.call(Trigger, f"/robotd/{service}").success
    assert client.send_goal(goal((1.5, pose(0.0)))).result()[0] == GoalStatus.STATUS_SUCCEEDED


@pytest.mark.daily
def test_a_stop_ends_a_goal_and_the_next_is_rejected_until_the_reset(
    cr3a: RobotProcess, client: Client, joints: list[Any], stopped: list[Any]
) -> None:
    assert stopped[-1].data == ""
    sent = client.send_goal(goal((10.0, pose(1.0))))
    client.next(joints, lambda message: message.position[0] > 0.05)
    assert robotd(cr3a.domain, "stop")[:2] == (0, "stopped, at rest\n")
    status, result = sent.result()
    assert status == GoalStatus.STATUS_ABORTED
    wait_until(lambda: stopped[-1].data, "the reason on the topic")
    reason = stopped[-1].data
    assert reason in (BY_MESSAGE, BY_SERVICE)  # the command sends both; the first to come counts
    assert result.error_string.startswith(f"stopped: {reason}")
    status, result = client.send_goal(goal((1.0, pose(0.0)))).result()
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_string == f"motion is stopped: {reason}; robotd reset allows it again"
    code, output, _ = robotd(cr3a.domain, "status")
    assert (code, f"stopped: {reason}" in output) == (1, True)
    assert robotd(cr3a.domain, "reset")[0] == 0
    wait_until(lambda: stopped[-1].data == "", "the reset on the topic")


def test_a_message_on_the_stop_topic_stops_moves_of_single_axes(
    client: Client, joints: list[Any], stopped: list[Any]
) -> None:
    diagnostics = client.listen(DiagnosticArray, "/diagnostics")
    stop = client.publisher(Empty, "/robotd/stop")
    moves = client.publisher(AxisPose, "/wmx/axis/position")
    move = AxisPose(index=[0], target=[1.0], velocity=[0.2], acc=[5.0], dec=[5.0])
    moves.publish(move)
    client.next(joints, lambda message: message.position[0] > 0.05)
    stop.publish(Empty())
    wait_until(lambda: stopped[-1].data == BY_MESSAGE, "the reason")
    client.next(joints, lambda message: abs(message.velocity[0]) < 1e-3)
    here = position(joints)[0]
    assert 0.05 < here < 0.9
    moves.publish(move)
    client.next(
        diagnostics,
        lambda message: any(
            status.name.endswith(": motion") and status.level == DiagnosticStatus.WARN
            for status in message.status
        ),
    )
    client.next(joints)
    assert position(joints)[0] == pytest.approx(here, abs=5e-3)


def test_a_goal_is_slowed_paused_and_resumed(
    cr3a: RobotProcess, client: Client, joints: list[Any]
) -> None:
    speeds = client.listen(Float64, "/robotd/speed", LATCHED)
    wait_until(lambda: speeds, "the latched message")
    assert speeds[-1].data == 1.0
    assert robotd(cr3a.domain, "speed", "50")[:2] == (0, "50 %\n")
    wait_until(lambda: speeds[-1].data == 0.5, "the speed of the command")
    speed = client.publisher(Float64, "/robotd/set_speed")
    sent = client.send_goal(goal((3.0, pose(0.9))))
    client.next(joints, lambda message: message.position[0] > 0.02)
    speed.publish(Float64(data=0.2))
    wait_until(lambda: speeds[-1].data == 0.2, "the speed of the topic")
    client.next(joints, lambda message: abs(message.velocity[0]) < 0.15)
    assert client.call(Trigger, "/robotd/pause").message == "paused (20 %)"
    client.next(joints, lambda message: abs(message.velocity[0]) < 1e-3)
    here = position(joints)[0]
    assert 0.0 < here < 0.85
    assert not sent.done
    speed.publish(Float64(data=1.0))
    assert client.call(Trigger, "/robotd/resume").success
    wait_until(lambda: speeds[-1].data == 1.0, "full speed")
    status, result = sent.result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    code, _, error = robotd(cr3a.domain, "speed", "0.5")
    assert (code, "0.5 is in percent: give 50 for 50 %" in error) == (2, True)


def test_a_joint_is_jogged_by_increments(
    cr3a: RobotProcess, client: Client, joints: list[Any]
) -> None:
    client.next(joints)
    begin = position(joints)
    for increment in ("+0.03", "-0.01"):
        code, output, error = robotd(cr3a.domain, "jog", "joint2", increment, "--speed", "0.5")
        assert code == 0, error
        assert output.startswith("joint2: +0.0")
    client.next(joints)
    assert position(joints)[1] - begin[1] == pytest.approx(0.02, abs=2e-3)
    assert position(joints)[0] == pytest.approx(begin[0], abs=2e-3)
    code, _, error = robotd(cr3a.domain, "jog", "joint9", "0.1")
    assert (code, "unknown joint 'joint9'" in error) == (1, True)
    code, _, error = robotd(cr3a.domain, "jog", "joint2", "1000")
    assert (code, "+1000 at 0.1 rad/s would take 20000 s" in error) == (2, True), error


def test_a_recovery_of_a_sound_robot_changes_nothing(client: Client) -> None:
    response = client.call(Trigger, "/robotd/recover")
    assert (response.success, response.message) == (
        True,
        "nothing is wrong: no axis has a fault",
    )
    reports = client.listen(RecoveryReport, f"/{RECOVERY}", LATCHED)
    wait_until(lambda: reports, "the latched report")
    assert reports[-1] == RecoveryReport(steps=[response.message])
