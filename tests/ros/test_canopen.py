"""The whole surface of the arm on CANopen drives in another process, by ROS."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from robotd_msgs.srv import ReadObject, WriteObject
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
from tests.plugins.canopen.bus.drives_process import DrivesProcess, write_robot
from tests.ros.robot_process import Client, RobotProcess, connected, wait_until
from tests.ros.test_client_commands import robotd
from trajectory_msgs.msg import JointTrajectoryPoint
from wmx_ros2_message.msg import AxisState
from wmx_ros2_message.srv import (
    EcatGetNetworkState,
    EcatRegisterRead,
    EcatStartHotconnect,
    GetIoBit,
    GetIoBytes,
    SetAxis,
    SetIoBytes,
)

pytestmark = pytest.mark.ros

JOINTS = [f"joint{number}" for number in range(1, 7)]
SPAN = 8  # samples
ALARM = "amplifier alarm 12816 (node 4: EMCY 0x3210 DC link over-voltage)"


@pytest.fixture(scope="module")
def drives() -> Iterator[DrivesProcess]:
    with DrivesProcess() as process:
        yield process


@pytest.fixture(scope="module")
def arm(drives: DrivesProcess, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RobotProcess]:
    path = write_robot(tmp_path_factory.mktemp("robot"))
    with RobotProcess(robot=str(path), backend="canopen") as process:
        process.wait_ready()
        yield process
        assert process.end() == 0, process.output


@pytest.fixture(scope="module")
def client(arm: RobotProcess) -> Iterator[Client]:
    with connected(arm) as client:
        yield client


@pytest.fixture(scope="module")
def joints(client: Client) -> list[Any]:
    return client.listen(JointState, "/joint_states", 500)


def stamp_s(message: Any) -> float:
    return float(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9)


def goal(seconds: int, position: float) -> Any:
    message = FollowJointTrajectory.Goal()
    message.trajectory.joint_names = JOINTS
    point = JointTrajectoryPoint(positions=[position] * 6, time_from_start=Duration(sec=seconds))
    message.trajectory.points = [point]
    return message


def succeed(client: Client, seconds: int, position: float) -> None:
    """Reach ``position``; again, at most twice, when the computer stalled robot or drives."""
    for _ in range(3):
        status, result = client.send_goal(goal(seconds, position)).result()
        if "control-loop stall" not in result.error_string:
            break
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string


def set_axis(client: Client, name: str, axes: list[int], data: list[int]) -> Any:
    return client.call(SetAxis, f"/wmx/axis/{name}", index=axes, data=data)


def told(client: Client, part: str) -> tuple[bytes, str]:
    """Level and message of a part in the next diagnostics."""
    messages = client.listen(DiagnosticArray, "/diagnostics")
    found = next(
        status for status in client.next(messages).status if status.name.endswith(f": {part}")
    )
    return found.level, found.message


def test_the_start_switches_all_servos_on(client: Client) -> None:
    states = client.listen(AxisState, "/wmx/axis/state")
    assert all(client.next(states).servo_on)
    scan = client.call(Trigger, "/wmx/engine/scan_network")
    assert "6 drives, 1 I/O modules" in scan.message


def test_a_trajectory_arrives_within_2_mrad_and_without_steps(
    client: Client, joints: list[Any]
) -> None:
    client.next(joints)
    start = len(joints)
    succeed(client, 1, 0.4)
    assert client.next(joints).position[:6] == pytest.approx([0.4] * 6, abs=2e-3)
    seen = joints[start:]
    positions = np.array([message.position[:6] for message in seen])
    times_s = np.array([stamp_s(message) for message in seen])
    assert len(positions) > 100
    # Over some periods: a computer that is late for one of them sends two in the next.
    speeds = np.abs(positions[SPAN:] - positions[:-SPAN]).max(1) / (
        times_s[SPAN:] - times_s[:-SPAN]
    )
    assert 0.5 < speeds.max() < 0.9, "from rest to rest the fastest is 1.5 to 1.875 of 0.4 rad/s"


def test_a_cancel_stops_in_order(client: Client, joints: list[Any]) -> None:
    for _ in range(3):
        sent = client.send_goal(goal(2, -0.8))
        wait_until(lambda: joints[-1].position[0] < 0.2, "motion")
        canceled = sent.cancel().goals_canceling
        if canceled:
            break
        succeed(client, 2, 0.4)  # the computer stalled robot or drives, and the goal has ended
    assert canceled
    assert sent.result()[0] == GoalStatus.STATUS_CANCELED
    stands = client.next(joints)
    assert max(map(abs, stands.velocity[:6])) < 0.02
    assert stands.position[0] > -0.7


def test_gripper_and_io(client: Client, drives: DrivesProcess) -> None:
    assert client.call(SetBool, "/wmx/set_gripper", data=True).success
    assert client.call(GetIoBit, "/wmx/io/get_output_bit", byte=0, bit=0).value == 1
    assert client.call(SetIoBytes, "/wmx/io/set_output_bytes", byte=1, data=b"\x5a").success
    answer = client.call(GetIoBytes, "/wmx/io/get_output_bytes", byte=0, length=2)
    assert bytes(answer.data) == b"\x01\x5a"
    drives.inject("16 input 1 3 1")
    wait_until(
        lambda: client.call(GetIoBit, "/wmx/io/get_input_bit", byte=1, bit=3).value == 1,
        "the input",
    )


def test_the_network_and_what_it_cannot(client: Client) -> None:
    network = client.call(EcatGetNetworkState, "/wmx/ecat/get_network_state", master_id=0)
    assert list(network.slave_ids) == [1, 2, 3, 4, 5, 6, 16]
    assert set(network.slave_states) == {16}
    assert "CANopen" in network.message
    read = client.call(
        EcatRegisterRead,
        "/wmx/ecat/register_read",
        master_id=0,
        slave_id=1,
        reg_address=0,
        length=4,
    )
    hot = client.call(EcatStartHotconnect, "/wmx/ecat/start_hotconnect", master_id=0)
    for answer in (read, hot):
        assert not answer.success
        assert "not supported by the canopen backend" in answer.message


def test_an_alarm_and_the_way_back(
    client: Client, joints: list[Any], drives: DrivesProcess
) -> None:
    succeed(client, 1, 0.3)
    sent = client.send_goal(goal(2, -0.6))
    wait_until(lambda: joints[-1].position[0] < 0.1, "motion")
    drives.inject("4 trip 0x3210")
    status, result = sent.result()
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_string.startswith("joint4 at ")
    assert ALARM in result.error_string
    assert told(client, "joint4") == (DiagnosticStatus.ERROR, ALARM)
    rejected = set_axis(client, "set_on", [3], [1])
    assert not rejected.success
    assert "EMCY 0x3210 DC link over-voltage" in rejected.message
    assert set_axis(client, "clear_alarm", [3], []).success
    assert set_axis(client, "set_on", [3], [1]).success
    succeed(client, 1, 0.0)


def test_a_lost_drive_and_the_way_back(
    client: Client, joints: list[Any], drives: DrivesProcess
) -> None:
    sent = client.send_goal(goal(2, 0.6))
    wait_until(lambda: joints[-1].position[0] > 0.1, "motion")
    drives.inject("3 reboot")
    status, result = sent.result()
    cause = "it was reset and has lost its configuration"
    assert status == GoalStatus.STATUS_ABORTED
    assert f"node 3: {cause}" in result.error_string
    client.wait_engine(ready=False)
    level, message = told(client, "engine")
    assert level == DiagnosticStatus.ERROR
    assert f"joint3 (node 3): {cause}" in message
    status, result = client.send_goal(goal(1, 0.0)).result()
    assert status == GoalStatus.STATUS_ABORTED
    assert "joint3 (node 3)" in result.error_string
    assert client.call(SetBool, "/wmx/engine/set_comm", data=True).success
    client.wait_engine()
    assert set_axis(client, "set_on", [2], [1]).success
    succeed(client, 1, 0.0)


def test_objects_of_a_drive_are_read_and_written(arm: RobotProcess, client: Client) -> None:
    ramp = {"node": 2, "index": 0x6083, "subindex": 0}
    written = client.call(WriteObject, "/wmx/ecat/write_object", **ramp, value=500_000)
    assert (written.success, written.message) == (True, "20 a1 07 00 (0x0007A120, 500000)")
    assert int.from_bytes(written.data, "little") == 500_000
    read = client.call(ReadObject, "/wmx/ecat/read_object", **ramp)
    assert (read.success, read.message, read.data) == (True, written.message, written.data)
    code, output, error = robotd(arm.domain, "sdo", "read", "2", "0x6083")
    assert (code, output) == (0, f"{written.message}\n"), error
    for fields, reason in (
        ({"node": 2, "index": 0x5FFF}, "abort 0x06020000"),
        ({"node": 99, "index": 0x1000}, "node 99 is not on bus 0"),
        ({"node": 2, "index": 0x10000}, "index 65536 is outside 0..0xffff"),
        ({"node": 2, "index": 0x1000, "subindex": -1}, "subindex -1 is outside 0..0xff"),
    ):
        read = client.call(ReadObject, "/wmx/ecat/read_object", **fields)
        assert (read.success, reason in read.message, [*read.data]) == (False, True, []), read
    too_large = client.call(WriteObject, "/wmx/ecat/write_object", **ramp, value=1 << 40)
    assert (too_large.success, too_large.message) == (
        False, "value 1099511627776 does not fit in 4 bytes"
    )  # fmt: skip
