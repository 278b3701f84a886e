"""From process start to its end: what is answered when, and what is left behind."""

from __future__ import annotations

import ctypes
import os
import pty
import select
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from control_msgs.action import FollowJointTrajectory
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger
from tests.ros.robot_process import (
    BACKEND,
    LATCHED,
    Client,
    RobotProcess,
    connected,
    stamp_s,
    wait_until,
)
from trajectory_msgs.msg import JointTrajectoryPoint
from wmx_ros2_message.msg import AxisState
from wmx_ros2_message.srv import EcatGetNetworkState, GetIoBit, SetAxis, SetEngine

pytestmark = [pytest.mark.ros, pytest.mark.second_backend]

UNWILLING = """\
schema: 1
name: unwilling
axes: 2
engine: {{open_tries: {tries}, open_retry_s: {retry_s}}}
nodes: [wmx_engine_node, wmx_core_motion_node, wmx_io_node, wmx_ethercat_node]
backends:
  sim: {{fail_open: {failures}, open_delay_s: {delay_s}}}
  wmx: {{lock_timeout_s: {patience_s}}}
"""

SLOW_ARM = """\
schema: 1
name: slow
extends: {cr3a}
backends: {{sim: {{communication_delay_s: 2.0}}}}
"""

ROBOTS = Path(__file__).parents[2] / "robots"
LIBC = ctypes.CDLL(None)
STALL_S = 0.008  # what a device bridges is longer, e.g. WMX's ``stream_buffer_s``
STANDIN_LOCKED = "WMX_STANDIN_LOCKED"


@pytest.fixture(autouse=True)
def willing_again() -> Iterator[None]:
    """The next test's engine is not what ``unwilling`` made of this one's."""
    yield
    os.environ.pop(STANDIN_LOCKED, None)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Any]:
    """Starts processes with a client each, and ends them."""
    opened: list[Any] = []

    def start(
        *arguments: str, robot: str = "cr3a", simulated_time: bool = False
    ) -> tuple[RobotProcess, Client]:
        process = RobotProcess(*arguments, robot=robot, simulated_time=simulated_time)
        client = Client(process.domain)
        opened.extend((client.close, process.__exit__))
        return process, client

    yield start
    for close in opened:
        close()


def unwilling(
    folder: Path, tries: int, failures: int, retry_s: float = 0.2, delay_s: float = 0.0
) -> str:
    """A robot whose device fails to open ``failures`` times, ``delay_s`` after it was asked to.

    The stand-in of WMX takes the failures from the environment, not from the robot's file.
    """
    os.environ[STANDIN_LOCKED] = str(failures)
    path = folder / "unwilling" / "robot.yaml"
    path.parent.mkdir()
    path.write_text(
        UNWILLING.format(
            tries=tries,
            failures=failures,
            retry_s=retry_s,
            delay_s=delay_s,
            patience_s=max(delay_s, 0.01),
        )
    )
    return str(path)


def test_services_answer_before_the_engine_is_ready(start: Any, tmp_path: Path) -> None:
    process, client = start(robot=unwilling(tmp_path, tries=1000, failures=1000))
    status = client.call(Trigger, "/wmx/engine/get_status")
    assert (status.success, status.message) == (True, "Idle")
    for response in (
        client.call(SetAxis, "/wmx/axis/set_on", index=[0], data=[1]),
        client.call(GetIoBit, "/wmx/io/get_input_bit"),
        client.call(EcatGetNetworkState, "/wmx/ecat/get_network_state"),
        client.call(SetBool, "/wmx/engine/set_comm", data=True),
    ):
        assert not response.success
        assert "not" in response.message
    client.wait_engine(ready=False)
    assert process.end() == 0  # while the start-up still tries


def test_a_failed_start_can_be_repeated_by_hand(start: Any, tmp_path: Path) -> None:
    process, client = start(robot=unwilling(tmp_path, tries=2, failures=2))
    process.wait_output("did not start")
    ready = client.listen(Bool, "/wmx/engine/ready", LATCHED)
    wait_until(lambda: ready and not ready[-1].data, "ready is false")
    assert client.call(SetEngine, "/wmx/engine/set_device", data=True).message == "Running"
    assert client.call(SetBool, "/wmx/engine/set_comm", data=True).message == "Communicating"
    wait_until(lambda: ready[-1].data, "ready is true")
    assert client.call(SetAxis, "/wmx/axis/set_on", index=[0], data=[1]).message == "axis 0: ok"
    assert process.end() == 0


def test_without_the_engine_node_a_failed_start_ends_the_process(tmp_path: Path) -> None:
    robot = unwilling(tmp_path, tries=1, failures=5)
    with RobotProcess("--nodes", "wmx_io_node", robot=robot) as process:
        assert process.exit_status() not in (0, 1)
        assert "unwilling" in process.output
        assert "Traceback" not in process.output


def test_the_engine_node_alone_enables_nothing(start: Any) -> None:
    process, client = start("--nodes", "wmx_engine_node")
    client.wait_engine()
    assert client.call(Trigger, "/wmx/engine/scan_network").success
    expected = {"wmx_engine_node", "robotd", "client"} | (
        {"robotd_sim"} if BACKEND == "sim" else set()
    )
    wait_until(lambda: set(client.node.get_node_names()) == expected, "these nodes alone")
    assert process.end(signal.SIGTERM) == 0
    assert "servos on" not in process.output


def test_restarting_the_engine_never_switches_a_servo_on(start: Any) -> None:
    process, client = start()
    process.wait_ready()
    ready = client.listen(Bool, "/wmx/engine/ready", LATCHED)
    states = client.listen(AxisState, "/wmx/axis/state")
    client.next(states, lambda message: all(message.servo_on))
    assert client.call(SetBool, "/wmx/engine/set_comm", data=False).message == "Running"
    wait_until(lambda: ready and not ready[-1].data, "ready is false")
    assert not client.call(SetBool, "/wmx/set_gripper", data=True).success
    assert client.call(SetEngine, "/wmx/engine/set_device", data=False).message == "Idle"
    assert client.call(SetEngine, "/wmx/engine/set_device", data=True).message == "Running"
    assert client.call(SetBool, "/wmx/engine/set_comm", data=True).message == "Communicating"
    assert not any(client.next(states).servo_on)
    response = client.call(SetAxis, "/wmx/axis/set_on", index=[0], data=[1])
    assert (response.success, response.message) == (True, "joint1: ok")
    client.next(states, lambda message: message.servo_on[0])


def steepest(joints: list[Any]) -> float:
    """The highest mean deceleration of joint1 down to rest, rad/s².

    By v²/2d of each sample, which has no time in it: a busy computer stamps samples late. Only of
    samples with no stall between them and rest: a device without setpoints has stopped at once.
    """
    at_rest, steepest, later = joints[-1].position[0], 0.0, joints[-1]
    for message in reversed(joints):
        if stamp_s(later) - stamp_s(message) > STALL_S:
            break
        if message.velocity[0] > 0.5:
            distance = max(at_rest - message.position[0], 1e-6)
            steepest = max(steepest, message.velocity[0] ** 2 / (2.0 * distance))
        later = message
    return steepest


def moving(client: Client) -> tuple[Any, list[Any]]:
    """A goal that moves all joints alike, at more than 1 rad/s now, and the joint states."""
    joints = client.listen(JointState, "/joint_states")
    client.next(joints)  # else the motion may be over before the subscription is matched
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = [f"joint{axis}" for axis in range(1, 7)]
    point = JointTrajectoryPoint(positions=[1.5] * 6)
    point.time_from_start.sec = 2
    goal.trajectory.points = [point]
    sent = client.send_goal(goal)
    client.next(joints, lambda message: message.velocity[0] > 1.0)
    return sent, joints


def check_stopped_in_order(output: str, sent: Any, joints: list[Any]) -> None:
    """The joints came to rest along their path, the client has the result, the servos are off."""
    _status, result = sent.result()
    assert "stopped by the robot" in result.error_string
    assert max(map(abs, joints[-1].velocity[:6])) < 0.05
    assert steepest(joints) < 25.0  # joint1 may slow down by 12.57 rad/s²: it was not cut off
    assert max(joints[-1].position[:6]) - min(joints[-1].position[:6]) < 0.02
    assert "outcome=aborted" in output  # as the client got it
    assert output.index("servos off") < output.index("communication stopped")
    for trouble in ("Traceback", "servo off failed", "controlled stop failed"):
        assert trouble not in output


@pytest.mark.parametrize(
    "number",
    [
        pytest.param(signal.SIGINT, marks=pytest.mark.daily),
        signal.SIGTERM,
        signal.SIGHUP,
        signal.SIGQUIT,
    ],
)
def test_a_signal_during_motion_stops_it_in_order(start: Any, number: int) -> None:
    process, client = start(simulated_time=True)
    process.wait_ready()
    ready = client.listen(Bool, "/wmx/engine/ready", LATCHED)
    sent, joints = moving(client)
    assert process.end(number) == 0
    check_stopped_in_order(process.output, sent, joints)
    assert "device closed" in process.output
    wait_until(lambda: not ready[-1].data, "ready is false at the end")


@pytest.fixture
def terminal() -> Iterator[tuple[int, Callable[[], None]]]:
    """A pseudo-terminal whose output is read, and a function that closes it."""
    master, slave = pty.openpty()
    lost = threading.Event()

    def read() -> None:
        while not lost.is_set():
            if select.select([master], [], [], 0.05)[0]:
                os.read(master, 4096)
        os.close(master)

    reader = threading.Thread(target=read)
    reader.start()

    def lose() -> None:
        lost.set()
        reader.join()

    yield slave, lose
    lose()
    os.close(slave)


def test_the_loss_of_the_terminal_stops_the_robot_in_order(
    terminal: tuple[int, Callable[[], None]],
) -> None:
    """The kernel, the shell and the session manager signal one after the other."""
    slave, lose = terminal
    with RobotProcess(terminal=slave) as process, connected(process) as client:
        states = client.listen(AxisState, "/wmx/axis/state")
        client.next(states, lambda message: all(message.servo_on[:6]))
        log = client.listen(Log, "/rosout", 100)
        sent, joints = moving(client)
        lose()
        wait_until(lambda: any("stopping" in record.msg for record in log), "the stop")
        process.process.send_signal(signal.SIGHUP)
        process.process.send_signal(signal.SIGTERM)
        assert process.exit_status() == 0
        # The client takes them in one after the other, among joint states.
        wait_until(
            lambda: any("device closed" in record.msg for record in log), "the end of the log"
        )
        check_stopped_in_order("\n".join(record.msg for record in log), sent, joints)


def test_under_nohup_the_robot_outlives_its_terminal() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # the process inherits it
    try:
        process = RobotProcess(simulated_time=True)
    finally:
        signal.signal(signal.SIGHUP, before)
    with process, connected(process) as client:
        process.wait_ready()
        sent, _ = moving(client)
        process.process.send_signal(signal.SIGHUP)
        assert sent.result()[1].error_code == 0
        assert process.end() == 0


def test_a_signal_that_wakes_another_thread_stops_the_robot() -> None:
    with RobotProcess() as process:
        process.wait_ready()
        threads = [int(task.name) for task in Path(f"/proc/{process.process.pid}/task").iterdir()]
        oldest = sorted(threads)[1]  # a younger one may end before it has taken the signal
        assert LIBC.tgkill(process.process.pid, oldest, signal.SIGTERM) == 0
        assert process.exit_status() == 0
        assert "device closed" in process.output


def test_nothing_is_switched_on_after_a_signal_during_start_up(tmp_path: Path) -> None:
    robot = tmp_path / "slow.yaml"
    robot.write_text(SLOW_ARM.format(cr3a=ROBOTS / "cr3a" / "robot.yaml"))
    with RobotProcess(robot=str(robot), backend="sim") as process:
        process.wait_output("fieldbus scanned")  # communication begins two seconds later
        assert process.end() == 0
        assert "servos on" not in process.output
        assert "parameters loaded" not in process.output
        assert "device closed" in process.output
        assert "Traceback" not in process.output


def test_a_second_signal_ends_the_process_at_once(start: Any, tmp_path: Path) -> None:
    robot = unwilling(tmp_path, tries=1000, failures=1000, retry_s=0.0, delay_s=8.0)
    process, client = start(robot=robot)
    problems = client.listen(DiagnosticArray, "/robotd/problems", LATCHED)
    wait_until(lambda: "try 2 of 1000" in str(problems), "a try of eight seconds")
    process.process.send_signal(signal.SIGINT)
    process.wait_output("stopping")

    def ended_by_another() -> bool:
        process.process.send_signal(signal.SIGINT)
        return process.process.poll() is not None

    wait_until(ended_by_another, "a second signal")
    assert process.exit_status() == 130


def test_the_echo_of_a_signal_is_not_a_second_one() -> None:
    with RobotProcess() as process:
        process.wait_ready()
        process.process.send_signal(signal.SIGINT)
        assert process.end(signal.SIGINT) == 0
        assert "device closed" in process.output


@pytest.mark.parametrize(
    ("parameter", "key", "reason"),
    [
        ("joint_number:=9", "manipulator_state.joint_number", "9 contradicts joints: 6 ("),
        ("joint_number:=six", "joint_number", "'six' is not a whole number"),
        (
            "joint_feedback_rate:=0",
            "manipulator_state.joint_feedback_rate",
            "0 is outside 1 to 500",
        ),
        ("joint_feedback_rate:=100000", "joint_feedback_rate", "100000 is outside 1 to 500"),
        ("encoder_joint_topic:=''", "manipulator_state.encoder_joint_topic", "empty"),
        (
            "encoder_joint_topic:=/rosout",
            "manipulator_state",
            "'/rosout' cannot be a topic of",
        ),
        ("encoder_joint_topic:='/a b'", "manipulator_state.encoder_joint_topic", "'/a b'"),
        (
            "joint_name:=[a, b]",
            "manipulator_state.joint_name",
            "['a', 'b'] contradicts joints: ['joint1', ",
        ),
        (
            "wmx_param_file_path:=/nowhere.xml",
            "manipulator_state.wmx_param_file_path",
            "'/nowhere.xml' does not exist",
        ),
    ],
)
def test_a_wrong_parameter_ends_the_process_before_anything_opens(
    parameter: str, key: str, reason: str
) -> None:
    with RobotProcess("--ros-args", "-p", parameter) as process:
        assert process.exit_status() == 3
        assert key in process.output
        assert reason in process.output
        assert "device open" not in process.output
        assert "Traceback" not in process.output
