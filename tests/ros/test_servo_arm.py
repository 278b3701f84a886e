"""Joint states of an arm of Feetech servos on their simulated bus: effort is not known."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from sensor_msgs.msg import JointState
from tests.plugins.serial_servo.sts_bus import StsBus
from tests.plugins.serial_servo.sts_servo import Servo
from tests.ros.robot_process import Client, RobotProcess, connected

ANGLES = {number: 0.1 * number for number in range(1, 7)}

pytestmark = [pytest.mark.ros, pytest.mark.long]


def write_arm(folder: Path, port: str) -> Path:
    """SO-101 whose servos are mounted with their middle at 0 rad."""
    axes = [{"axis": axis, "servo": axis + 1, "zero_tick": 2048} for axis in range(6)]
    robot = {
        "schema": 1,
        "name": "arm",
        "extends": "so101",
        "backend": "feetech",
        "engine": {"stale_after_s": 5.0, "servo_timeout_s": 30.0, "shutdown_s": 30.0},
        "backends": {
            "feetech": {"port": port, "axes": axes, "reply_timeout_s": 0.2, "lost_after_s": 1.0}
        },
    }
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(robot), encoding="utf-8")
    return path


@pytest.fixture
def client(tmp_path: Path) -> Iterator[Client]:
    servos = {number: Servo(angle=angle) for number, angle in ANGLES.items()}
    for servo in servos.values():
        servo.set("return_delay", 0)
    with StsBus(servos, seed=1) as bus:
        robot = write_arm(tmp_path, bus.port)
        with RobotProcess(robot=str(robot), backend="feetech") as process:
            process.wait_ready()
            with connected(process) as client:
                yield client


def test_effort_that_no_servo_measures_is_nan(client: Client) -> None:
    states = client.listen(JointState, "/joint_states")
    state = client.next(states, lambda state: len(state.name) == len(ANGLES))
    assert list(state.position) == pytest.approx(list(ANGLES.values()), abs=0.02)
    assert len(state.effort) == len(ANGLES)
    assert all(map(math.isnan, state.effort))
