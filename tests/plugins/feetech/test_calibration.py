"""Files of LeRobot, angles as LeRobot computes them, and what is refused."""

from __future__ import annotations

import json
import math
from pathlib import Path
from unittest.mock import Mock

import pytest
from tests.fakes import FakeClock
from tests.plugins.feetech.fake_bus import FakeServo, FakeServoBus

from robotd.api import DescriptorError, InvalidArgument, load_robot_descriptor
from robotd_feetech.options import FeetechOptions
from robotd_serial_servo.calibration import (
    Scale,
    half_turn_offset,
    read_calibration,
    write_calibration,
)
from robotd_serial_servo.hand_calibration import Ranges, calibrations, save
from robotd_serial_servo.options import ServoPlan
from robotd_serial_servo.servo_bus import BusError, NoReply

# As lerobot 0.6 writes it: draccus, indent 4.
LEROBOT = {
    "shoulder_pan": [1, 0, -1470, 758, 3292],
    "shoulder_lift": [2, 0, 853, 864, 3278],
    "elbow_flex": [3, 0, 1015, 887, 3121],
    "wrist_flex": [4, 0, -1332, 862, 3203],
    "wrist_roll": [5, 0, 1234, 0, 4095],
    "gripper": [6, 1, 1407, 2030, 3490],
}
GRIPPER_MIDDLE = 0.7855  # rad, between the limits of the URDF, which has 0 near the closed end
KEYS = ("id", "drive_mode", "homing_offset", "range_min", "range_max")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "my_arm.json"
    content = {name: dict(zip(KEYS, values, strict=True)) for name, values in LEROBOT.items()}
    path.write_text(json.dumps(content, indent=4), encoding="utf-8")
    return path


def plan_of(file: Path) -> ServoPlan:
    robot = load_robot_descriptor("so101")
    options = FeetechOptions.model_validate(robot.backends["feetech"] | {"calibration": file})
    return options.check_robot(robot)


def test_angles_are_those_of_lerobot_within_a_tick(file: Path) -> None:
    for servo in plan_of(file).servos:
        _, _, _, low, high = LEROBOT[servo.name]
        for ticks in (low, high, 2047, low + 300):
            degrees = (ticks - (low + high) / 2) * 360 / 4095  # motors_bus._normalize, DEGREES
            ours = servo.scale.angle(ticks) - (GRIPPER_MIDDLE if servo.name == "gripper" else 0.0)
            assert ours == pytest.approx(math.radians(degrees), abs=2 * math.pi / 4096)


def test_a_calibrated_arm_reaches_the_limits_of_its_descriptor(file: Path) -> None:
    """A gripper with 0 in the middle of its range could not close."""
    limits = {
        joint.name: (joint.lower, joint.upper) for joint in load_robot_descriptor("so101").joints
    }
    for servo in plan_of(file).servos:
        ends = [servo.scale.angle(ticks) for ticks in servo.range_ticks]
        assert ends == pytest.approx(limits[servo.name], abs=0.5), servo.name


def test_goals_stay_in_the_calibrated_range(file: Path) -> None:
    gripper = plan_of(file).servos[5]
    assert gripper.range_ticks == (2030, 3490)
    assert gripper.torque_limit == 0.5
    assert gripper.scale.ticks(gripper.scale.angle(2222)) == 2222


def test_a_file_is_written_as_lerobot_reads_it(file: Path, tmp_path: Path) -> None:
    copy = tmp_path / "folder" / "copy.json"
    write_calibration(copy, read_calibration(file))
    assert json.loads(copy.read_text()) == json.loads(file.read_text())


def test_a_polarity_turns_angles_and_ticks_alike() -> None:
    scale = Scale(2000.0, -1)
    assert scale.angle(2100) < 0.0
    assert scale.ticks(scale.angle(2100)) == 2100


def test_the_offset_of_the_middle_is_that_of_lerobot() -> None:
    assert half_turn_offset(3000, 0) == 3000 - 2047
    assert half_turn_offset(2047, 953) == 953
    assert half_turn_offset(100, -200) == (100 - 200) % 4096 - 2047


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ('{"homing_offset": [1], "start_pos": [2], "calib_mode": ["DEGREE"]}', "before 0.2"),
        ('{"gripper": {"id": 6}}', "gripper"),
        ("[]", "is not a calibration"),
        (
            '{"gripper": {"id": 6, "homing_offset": 0, "range_min": 9, "range_max": 9}}',
            "range_min 9 is not below",
        ),
    ],
)
def test_what_is_no_calibration_is_refused(tmp_path: Path, content: str, text: str) -> None:
    path = tmp_path / "file.json"
    path.write_text(content)
    with pytest.raises(DescriptorError, match=text):
        read_calibration(path)


def test_an_arm_without_a_zero_is_not_driven() -> None:
    robot = load_robot_descriptor("so101")
    options = FeetechOptions.model_validate(robot.backends["feetech"])
    with pytest.raises(DescriptorError, match=r"no zero of shoulder_pan, .*'robotd calibrate'"):
        options.check_robot(robot)


def test_servos_that_do_not_fit_are_named_together(file: Path) -> None:
    robot = load_robot_descriptor("so101")
    section = {"calibration": file, "axes": [{"axis": 0, "servo": 2}, {"axis": 1, "servo": 2}]}
    with pytest.raises(DescriptorError, match=r"(?s)servo 2 is used twice.*no servo for axis 2"):
        FeetechOptions.model_validate(section).check_robot(robot)
    swapped = [{**keys, "servo": 7 - keys["servo"]} for keys in robot.backends["feetech"]["axes"]]
    section = {"calibration": file, "axes": swapped}
    with pytest.raises(DescriptorError, match="gripper is servo 6 in the calibration, 1 in axes"):
        FeetechOptions.model_validate(section).check_robot(robot)


def test_ranges_by_hand_become_a_calibration() -> None:
    joints = {"shoulder_pan": 1, "wrist_roll": 5}
    found = calibrations(
        joints, {"shoulder_pan": -7, "wrist_roll": 12}, {"shoulder_pan": (800, 3000),
        "wrist_roll": (3, 4090)},
    )  # fmt: skip
    assert found["shoulder_pan"].range_min == 800
    assert (found["wrist_roll"].range_min, found["wrist_roll"].range_max) == (0, 4095)


def bus_of(servos: dict[int, FakeServo]) -> FakeServoBus:
    return FakeServoBus(FakeClock(), servos)


def test_a_joint_that_was_not_moved_is_named_and_nothing_is_written(tmp_path: Path) -> None:
    bus = bus_of({1: FakeServo(), 2: FakeServo()})
    ranges = Ranges(bus, {"pan": 1, "lift": 2})
    bus.servos[1].position += 900
    ranges.follow()
    with pytest.raises(InvalidArgument, match="lift: not moved"):
        save(bus, {"pan": 1, "lift": 2}, {"pan": 0, "lift": 0}, ranges, tmp_path / "arm.json")
    assert bus.calls == []
    assert list(tmp_path.iterdir()) == []


def test_a_servo_that_is_on_ends_the_calibration() -> None:
    bus = bus_of({1: FakeServo()})
    ranges = Ranges(bus, {"pan": 1})
    ranges.follow()
    bus.servos[1].torque = True
    with pytest.raises(BusError, match="servo 1, pan, is on without a command"):
        ranges.follow()


def test_a_servo_that_is_silent_ends_the_calibration(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 100.0
    monkeypatch.setattr("time.monotonic", lambda: now_s)
    bus = bus_of({1: FakeServo(), 2: FakeServo()})
    ranges = Ranges(bus, {"pan": 1, "lift": 2})
    now_s += 60.0  # a stall
    bus.servos[2].silent = True
    ranges.follow()
    now_s += 1.9
    ranges.follow()
    assert ranges.now == {"pan": 2000}
    now_s += 0.2
    with pytest.raises(NoReply, match="servo 2, lift, has not answered for 2 s"):
        ranges.follow()


def test_a_servo_that_misses_a_read_keeps_its_range() -> None:
    bus = Mock()
    reads = ({1: 2000, 2: 2047}, {1: 900}, {1: 1500, 2: 3000}, {2: 2500})
    bus.read.side_effect = [
        {servo: Mock(position=position, torque=False) for servo, position in read.items()}
        for read in reads
    ]
    ranges = Ranges(bus, {"pan": 1, "lift": 2})
    for _ in reads[1:]:
        ranges.follow()
    assert ranges.found == {"pan": (900, 2000), "lift": (2047, 3000)}
    assert ranges.now == {"lift": 2500}
