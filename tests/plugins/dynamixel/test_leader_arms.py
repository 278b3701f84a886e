"""Leader arms of Dynamixel servos on their simulated bus: read, and never switched on."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from tests.plugins.serial_servo.dxl_bus import DxlBus
from tests.plugins.serial_servo.dxl_servo import Servo

from robotd import DescriptorError, open_robot
from robotd.api import MonotonicClock, OperationError, load_robot_descriptor, wait_until
from robotd_dynamixel.options import DynamixelOptions
from robotd_serial_servo.calibration import JointCalibration, write_calibration

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
ANGLES = {number: 0.2 * number for number in range(1, 7)}
WAIT_S = 30.0


def write_robot(folder: Path, extends: str, port: str) -> Path:
    """A leader whose servos are mounted with their middle at 0 rad, as calibrated."""
    joints = {
        name: JointCalibration(
            id=number, homing_offset=0, range_min=0, range_max=4096, drive_mode=0
        )
        for number, name in enumerate(JOINTS, 1)
    }
    write_calibration(folder / "leader.json", joints)
    section = {"port": port, "reply_timeout_s": 0.2, "lost_after_s": 1.0}
    robot = {
        "schema": 1,
        "name": "leader",
        "extends": extends,
        "engine": {"stale_after_s": 5.0},
        "backends": {"dynamixel": {**section, "calibration": "../leader.json"}},
    }
    path = folder / "leader" / "robot.yaml"
    path.parent.mkdir()
    path.write_text(yaml.safe_dump(robot), encoding="utf-8")
    return path


@pytest.mark.long
@pytest.mark.parametrize("leader", ["koch_leader", "omx_leader"])
def test_a_leader_shows_its_pose_with_its_servos_off(leader: str, tmp_path: Path) -> None:
    axes = load_robot_descriptor(leader).backends["dynamixel"]["axes"]
    servos = {keys["servo"]: Servo(keys["model"], angle=ANGLES[keys["servo"]]) for keys in axes}
    for servo in servos.values():
        servo.set("return_delay", 0)
    with DxlBus(servos, seed=1) as bus:
        robot_file = write_robot(tmp_path, leader, bus.port)
        with open_robot(robot_file, "dynamixel", enable=False) as robot:
            expected = pytest.approx(list(ANGLES.values()), abs=0.01)
            assert robot.joint_names == JOINTS
            assert wait_until(
                lambda: robot.image.copy().position.tolist() == expected, WAIT_S, MonotonicClock()
            ), robot.image.copy().position
            with pytest.raises(OperationError, match="moved by hand"):
                robot.axes.servo(0, True)
        assert not any(step.torque for servo in servos.values() for step in servo.executed)


def test_an_arm_without_published_zeros_needs_a_calibration() -> None:
    robot = load_robot_descriptor("koch")
    options = DynamixelOptions.model_validate(robot.backends["dynamixel"])
    with pytest.raises(DescriptorError, match=r"no zero of shoulder_pan, .* is known"):
        options.check_robot(robot)
