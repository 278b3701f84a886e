"""Servo off and stops reach the drives while no values come, through each door."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from std_msgs.msg import Bool
from tests.ros.robot_process import LATCHED, Client, RobotProcess, wait_until
from tests.ros.test_client_commands import robotd
from wmx_ros2_message.msg import AxisState
from wmx_ros2_message.srv import SetAxis

pytestmark = pytest.mark.ros

AXES = [0, 1, 2, 3, 4, 5]
LOST_FRAMES = 15_000  # at 1 kHz: 15 s of the simulated network


class Lost:
    """A simulated arm whose network is silent for a while."""

    def __init__(self, process: RobotProcess, client: Client) -> None:
        self.process, self.client = process, client
        self.states = client.listen(AxisState, "/wmx/axis/state")
        self.ready = client.listen(Bool, "/wmx/engine/ready", LATCHED)
        wait_until(lambda: self.ready and self.ready[-1].data, "ready")
        assert self.set_axis("set_on", [1] * 6).success
        answer = client.inject("packet_loss", count=LOST_FRAMES)
        assert answer.success, answer.message
        wait_until(lambda: not self.ready[-1].data, "values are stale")

    def set_axis(self, name: str, data: list[int]) -> Any:
        return self.client.call(SetAxis, f"/wmx/axis/{name}", index=AXES, data=data)

    def wait_back(self) -> Any:
        """Return the state of the axes when values come again."""
        wait_until(lambda: self.ready[-1].data, "ready again")
        return self.client.next(self.states)


@pytest.fixture(scope="module")
def process() -> Iterator[RobotProcess]:
    with RobotProcess(backend="sim") as process:
        process.wait_ready()
        yield process


@pytest.fixture
def lost(process: RobotProcess) -> Iterator[Lost]:
    client = Client(process.domain)
    try:
        yield Lost(process, client)
    finally:
        client.close()


def test_servos_go_off_by_the_service_which_says_what_is_not_known(lost: Lost) -> None:
    response = lost.set_axis("set_on", [0] * 6)
    assert not response.success
    for number in range(1, 7):
        assert f"joint{number}: servo off was sent and is not confirmed" in response.message
    assert not lost.set_axis("set_on", [1] * 6).success
    assert not any(lost.wait_back().servo_on)


def test_servos_go_off_by_the_command(lost: Lost) -> None:
    status, output, error = robotd(lost.process.domain, "servo", "off")
    assert status != 0
    assert "is not confirmed" in output + error
    assert not any(lost.wait_back().servo_on)


def test_a_stop_of_axes_is_accepted(lost: Lost) -> None:
    response = lost.set_axis("stop", [0] * 6)
    assert response.success, response.message
    assert all(lost.wait_back().servo_on)
