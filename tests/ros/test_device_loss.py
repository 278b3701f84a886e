"""A device that is lost and comes back: what the log, the commands and the diagnostics say."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from tests.plugins.canopen.bus.drives_process import DrivesProcess, write_robot
from tests.ros.robot_process import LATCHED, Client, RobotProcess, wait_until
from tests.ros.test_client_commands import robotd

from robotd.cli.exit_codes import ExitCode

pytestmark = pytest.mark.ros

SWITCHED_ON = "servos on: joint1, joint2, joint3, joint4, joint5, joint6"


def lines_with(process: RobotProcess, text: str) -> list[str]:
    return [line for line in process.output.splitlines() if text in line]


def engine_diagnostics(client: Client) -> tuple[bytes, str]:
    messages = client.listen(DiagnosticArray, "/diagnostics")
    message = client.next(messages)
    found = next(status for status in message.status if status.name.endswith(": engine"))
    return found.level, found.message


def test_lost_drives_are_named_and_brought_back(tmp_path: Path) -> None:
    with (
        DrivesProcess() as drives,
        RobotProcess(robot=str(write_robot(tmp_path)), backend="canopen") as process,
    ):
        process.wait_ready()
        client = Client(process.domain)
        try:
            ready = client.listen(Bool, "/wmx/engine/ready", LATCHED)
            wait_until(lambda: ready and ready[-1].data, "ready")
            drives.stop()
            wait_until(lambda: not ready[-1].data, "not ready")
            wait_until(
                lambda: lines_with(process, "device lost component=control"), "the line of the log"
            )
            check_lost(process, client, "(node ")  # of any drive: the first to be missed
            drives.start()
            wait_until(lambda: lines_with(process, "answer again and need"), "the return")
            status, output, _ = robotd(process.domain, "status")
            assert status == 1
            assert "start communication" in output
            check_recovered(process)
            wait_until(lambda: ready[-1].data, "ready again")
            report = json.loads(robotd(process.domain, "status", "--json")[1])
            assert (report["ready"], report["problems"]) == (True, [])
            assert len(lines_with(process, "device lost component=control")) == 1
            assert len(lines_with(process, "device is back")) == 1
        finally:
            client.close()
        assert process.end() == 0
        assert "Traceback" not in process.output


def check_recovered(process: RobotProcess) -> None:
    """The command names the cause and reports its steps; a second one finds nothing wrong."""
    status, output, error = robotd(process.domain, "recover")
    assert status == 0, error
    assert not error or error.startswith("robot: "), "a warning"  # what is known by then
    assert len(error.splitlines()) == 1
    found, *steps = output.splitlines()
    assert found.startswith("found: engine is not ready (state Unknown): ")
    assert "(node " in found
    assert steps[0] == "reconnecting"
    assert steps[1].startswith("reconnected after ")
    assert steps[-2] == SWITCHED_ON
    assert steps[-1].startswith("verified: 6 axes on, no alarm")
    assert robotd(process.domain, "recover")[1].startswith("nothing is wrong")


def check_lost(process: RobotProcess, client: Client, cause: str) -> None:
    """The cause is in the log line, the status, every command's answer and the diagnostics."""
    [line] = lines_with(process, "device lost component=control")
    assert cause in line
    status, output, error = robotd(process.domain, "status")
    assert (status, error) == (1, "")
    assert cause in output
    assert "robotd recover" in output
    report = json.loads(robotd(process.domain, "status", "--json")[1])
    assert (report["state"], report["ready"], report["axes"]) == ("Unknown", False, None)
    (problem,) = report["problems"]
    assert cause in problem["reason"]
    assert problem["remedy"].endswith("robotd recover")
    for command in (["servo", "on"], ["servo", "on", "2"], ["move", "joint1=0.1"]):
        status, _, error = robotd(process.domain, *command)
        assert status == 1, f"{command}: {error}"
        assert cause in error
        assert "no robot found" not in error
    level, message = engine_diagnostics(client)
    assert level == DiagnosticStatus.ERROR
    assert cause in message


def test_drives_that_come_late_or_back_are_reconnected_with_servos_off(tmp_path: Path) -> None:
    drives = DrivesProcess()
    changes = ("engine.reconnect=true", "engine.open_tries=1", "engine.open_retry_s=0.3")
    arguments = [word for change in changes for word in ("--set", change)]
    robot = str(write_robot(tmp_path))
    with RobotProcess(*arguments, robot=robot, backend="canopen") as process:
        client = Client(process.domain)
        try:
            process.wait_output("the robot did not start")
            answer = client.call(Trigger, "/robotd/recover")
            assert (answer.success, "do not answer as expected" in answer.message) == (False, True)
            ready = client.listen(Bool, "/wmx/engine/ready", LATCHED)
            for _ in range(2):
                drives.start()
                wait_until(lambda: ready and ready[-1].data, "ready without a command")
                answer = client.call(Trigger, "/robotd/recover")
                assert answer.success, answer.message
                assert SWITCHED_ON in answer.message  # robotd had left them off
                drives.stop()
                wait_until(lambda: not ready[-1].data, "not ready")
        finally:
            drives.stop()
            client.close()
        assert process.end() == ExitCode.SERVOS_NOT_OFF  # the drives are gone
        assert "Traceback" not in process.output


def test_a_slow_start_says_what_it_is_doing(tmp_path: Path) -> None:
    robot = tmp_path / "slow.yaml"
    cr3a = Path(__file__).parents[2] / "robots" / "cr3a" / "robot.yaml"
    options = "{sim: {communication_delay_s: 7.0}}"
    robot.write_text(f"schema: 1\nname: slow\nextends: {cr3a}\nbackends: {options}\n")
    with RobotProcess(robot=str(robot), backend="sim") as process:
        process.wait_output("fieldbus scanned")
        client = Client(process.domain)
        try:
            check_starting(process, client)
            process.wait_output("start-up takes long")
        finally:
            client.close()
        [line] = lines_with(process, "start-up takes long")
        assert "starting communication" in line
        assert "for_s=5" in line
        process.wait_ready()
        assert json.loads(robotd(process.domain, "status", "--json")[1])["ready"]


def check_starting(process: RobotProcess, client: Client) -> None:
    level, message = engine_diagnostics(client)
    assert level == DiagnosticStatus.WARN
    assert message.startswith("Running: starting communication for ")
    answer: Any = client.call(Trigger, "/wmx/engine/get_fault")
    assert "engine is not ready (state Running): starting communication for" in answer.message
    status, output, _ = robotd(process.domain, "status")
    assert status == 1
    assert "starting communication for" in output
