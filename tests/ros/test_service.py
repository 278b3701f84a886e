"""A robot under a supervisor: a restart energises nothing, and a manager follows its life."""

from __future__ import annotations

import os
import signal
import socket
import time
from pathlib import Path

import pytest
from std_srvs.srv import Trigger
from tests.ros.robot_process import WAIT_S, Client, RobotProcess
from wmx_ros2_message.msg import AxisState
from wmx_ros2_message.srv import SetAxis

pytestmark = pytest.mark.ros
ARGUMENTS = ("--set", "engine.enable_at_start=false")


def test_a_restarted_robot_stays_without_power_until_a_command(tmp_path: Path) -> None:
    address = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(address))
        manager.settimeout(WAIT_S)

        sent: list[str] = []  # READY and STATUS come in either order

        def wait_sent(text: str) -> None:
            deadline = time.monotonic() + WAIT_S
            while not any(text in text_sent for text_sent in sent):
                assert time.monotonic() < deadline, f"no {text} among {sent}"
                sent.append(manager.recv(4096).decode())

        environment = {"NOTIFY_SOCKET": str(address), "WATCHDOG_USEC": "3000000"}
        with RobotProcess(*ARGUMENTS, environment=environment) as robot:
            wait_sent("READY=1")
            wait_sent("joint6: servo off")
            client = Client(robot.domain)
            try:
                _require_power(client, on=False)
                axes = list(range(6))
                answer = client.call(SetAxis, "/wmx/axis/set_on", index=axes, data=[1] * 6)
                assert answer.success, answer.message
                wait_sent("STATUS=ready")
                _require_power(client, on=True)
                os.kill(robot.process.pid, signal.SIGKILL)
                robot.exit_status()
                sent.clear()
                with RobotProcess(
                    *ARGUMENTS, domain=robot.domain, environment=environment
                ) as next_one:
                    wait_sent("READY=1")
                    wait_sent("joint6: servo off")
                    _require_power(client, on=False)
                    answer = client.call(Trigger, "/robotd/recover")
                    assert answer.success, answer.message
                    wait_sent("STATUS=ready")
                    assert next_one.end(signal.SIGTERM) == 0
                    wait_sent("STOPPING=1")
            finally:
                client.close()


def _require_power(client: Client, *, on: bool) -> None:
    states = client.listen(AxisState, "/wmx/axis/state")
    assert list(client.next(states).servo_on) == [on] * 6
