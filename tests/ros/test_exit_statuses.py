"""Text and exit status of commands for a robot that cannot move."""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
from tests.ros.robot_process import LATCHED, WAIT_S, Client, RobotProcess, connected, wait_until
from tests.ros.test_client_commands import robotd, started

from robotd.cli.exit_codes import ExitCode
from robotd_ros.problem_messages import read_problems

pytestmark = pytest.mark.ros

ALARM = "joint3: amplifier alarm 8976 (continuous overcurrent)"


@pytest.fixture(scope="module")
def simulated() -> Iterator[RobotProcess]:
    """An arm whose faults can be injected."""
    with RobotProcess("--time-scale", "1", backend="sim") as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def operator(simulated: RobotProcess) -> Iterator[Client]:
    with connected(simulated) as client:
        yield client


@pytest.fixture(autouse=True)
def sound(operator: Client) -> Iterator[None]:
    """Leave the robot without a fault, a stop or a reduced speed."""
    yield
    operator.publisher(Float64, "/robotd/set_speed").publish(Float64(data=1.0))
    for service in ("recover", "reset", "resume"):
        assert operator.call(Trigger, f"/robotd/{service}").success
    problems = operator.listen(DiagnosticArray, "/robotd/problems", LATCHED)
    wait_until(lambda: problems and not problems[-1].status, "no problem")


def texts(message: DiagnosticArray) -> list[str]:
    return [problem.text for problem in read_problems(message)]


def test_status_is_1_in_alarm_and_names_it_with_its_remedy(
    simulated: RobotProcess, operator: Client
) -> None:
    problems = operator.listen(DiagnosticArray, "/robotd/problems", LATCHED)
    assert robotd(simulated.domain, "status")[:1] == (0,)
    assert robotd(simulated.domain, "sim", "inject", "amp_alarm", "axis=2")[0] == 0
    wait_until(lambda: texts(problems[-1]) == [ALARM], "the alarm on the topic")
    code, output, _ = robotd(simulated.domain, "status")
    assert code == 1
    assert ", cannot move" in output
    remedy = output.partition(f"problem   {ALARM}\n")[2].splitlines()[0].strip()
    assert remedy.endswith(", then: robotd recover")
    code, output, _ = robotd(simulated.domain, "status", "--json")
    assert code == 1
    (problem,) = json.loads(output)["problems"]
    assert (problem["kind"], problem["axes"]) == ("alarm", ["joint3"])
    assert (problem["remedy"], ALARM) == (remedy, f"joint3: {problem['reason']}")
    assert problem["since_ns"] > 0


def test_a_speed_of_0_and_a_servo_that_is_off_stand_in_the_way_with_status_0(
    simulated: RobotProcess,
) -> None:
    assert robotd(simulated.domain, "speed", "0")[0] == 0
    assert robotd(simulated.domain, "servo", "off", "joint2")[0] == 0
    code, output, _ = robotd(simulated.domain, "status")
    assert code == 0
    assert ", cannot move" in output
    remedy = "To switch it on: robotd servo on"
    assert f"problem   joint2: servo off\n            {remedy}\n" in output
    remedy = "To go on: robotd speed 100"
    assert f"problem   the speed is 0 %\n            {remedy}\n" in output


def test_recover_is_1_while_a_stop_stays_in_force(
    simulated: RobotProcess, operator: Client
) -> None:
    problems = operator.listen(DiagnosticArray, "/robotd/problems", LATCHED)
    assert robotd(simulated.domain, "stop")[0] == 0
    assert robotd(simulated.domain, "sim", "inject", "amp_alarm", "axis=2")[0] == 0
    wait_until(lambda: problems and ALARM in texts(problems[-1]), "the alarm on the topic")
    code, output, _ = robotd(simulated.domain, "recover")
    assert code == 1
    assert output.splitlines()[0] == f"found: {ALARM}"
    stopped = output.splitlines()[-1]  # the command sends a message, too; the first to come counts
    by = "(a client of the stop service|a message on the stop topic)"
    assert re.fullmatch(f"motion is stopped: by {by}; robotd reset allows it again", stopped)
    sound = f"nothing is wrong: no axis has a fault\n{stopped}\n"
    assert robotd(simulated.domain, "recover")[:2] == (1, sound)
    assert robotd(simulated.domain, "reset")[0] == 0
    assert robotd(simulated.domain, "pause")[0] == 0
    code, output, _ = robotd(simulated.domain, "recover")
    assert code == 0
    assert output.endswith("motion is paused. To go on: robotd resume\n")


def test_a_robot_whose_time_stands_is_no_riddle(simulated: RobotProcess) -> None:
    assert robotd(simulated.domain, "sim", "pause")[0] == 0
    try:
        code, _, error = robotd(simulated.domain, "status", "--timeout", "2")
    finally:
        assert robotd(simulated.domain, "sim", "resume")[0] == 0
    assert code == 5
    assert "its time is simulated, and may be paused: robotd sim resume" in error


@pytest.mark.parametrize("words", [("move", "joint1=1.5", "--time", "30"), ("jog", "joint1", "1")])
def test_a_goal_is_canceled_when_its_terminal_is_lost(
    simulated: RobotProcess, operator: Client, words: tuple[str, ...]
) -> None:
    joints = operator.listen(JointState, "/joint_states")
    begin = operator.next(joints).position[0]
    environment = {"ROS_DOMAIN_ID": str(simulated.domain)}
    master, slave = pty.openpty()
    with subprocess.Popen(
        ["setsid", "--ctty", sys.executable, "-m", "robotd", *words],
        env=os.environ | environment,
        stdin=slave,
        stdout=slave,
        stderr=slave,
    ) as process:
        os.close(slave)
        wait_until(lambda: joints[-1].position[0] > begin + 0.02, "motion")
        os.close(master)
        process.send_signal(signal.SIGHUP)  # as the shell does, after the kernel
        assert process.wait(WAIT_S) == ExitCode.INTERRUPTED
    operator.next(joints)
    assert abs(joints[-1].velocity[0]) < 1e-3
    assert joints[-1].position[0] < begin + 0.9
    owners = operator.listen_owners()
    wait_until(lambda: owners and not owners[-1], "no owner")


def test_a_goal_is_canceled_by_sigquit(simulated: RobotProcess, operator: Client) -> None:
    joints = operator.listen(JointState, "/joint_states")
    begin = operator.next(joints).position[0]
    with started(simulated.domain, "move", "joint1=1.5", "--time", "30") as process:
        wait_until(lambda: joints[-1].position[0] > begin + 0.02, "motion")
        process.send_signal(signal.SIGQUIT)
        assert process.wait(WAIT_S) == ExitCode.INTERRUPTED
    operator.next(joints)
    assert abs(joints[-1].velocity[0]) < 1e-3
    assert joints[-1].position[0] < begin + 0.9
