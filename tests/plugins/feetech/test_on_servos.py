"""The backend on the simulated bus, judged by what its servos have executed, in real time."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from tests.plugins.serial_servo.sts_bus import StsBus
from tests.plugins.serial_servo.sts_servo import Servo
from tests.plugins.serial_servo.terminal import Terminal

from robotd import ConnectError, NotReady, Robot, RobotdError, open_robot
from robotd.api import MonotonicClock, Profile, wait_until
from robotd.api.robots import Move
from robotd.cli.main import main
from robotd_feetech import sts_bus
from robotd_serial_servo import bus_scan
from robotd_serial_servo.bus_scan import opened, scan_servos
from robotd_serial_servo.servo_faults import Fault

ANGLES = {1: -0.5, 2: 0.9}
SPEED_TICKS_S = 1304 * 1.2  # 2 rad/s, and the margin of the last line of defence
JUMP_TICKS = 30
WAIT_S = 30.0

pytestmark = pytest.mark.long  # real time: time-outs outlast the stalls of a busy computer


def write_robot(folder: Path, port: str, **options: object) -> Path:
    joints = [
        {
            "name": f"joint{axis + 1}", "axis": axis, "lower_rad": -2.5, "upper_rad": 2.5,
            "velocity_rad_s": 2.0, "acceleration_rad_s2": 8.0,
        }
        for axis in range(2)
    ]  # fmt: skip
    axes = [{"axis": axis, "servo": axis + 1, "zero_tick": 2048} for axis in range(2)]
    section = {
        "port": port, "axes": axes, "reply_timeout_s": 0.2, "lost_after_s": 1.0, **options
    }  # fmt: skip
    robot = {
        "schema": 1,
        "name": "arm",
        "backend": "feetech",
        "cycle": {"rate_hz": 100},
        "engine": {"stale_after_s": 5.0, "open_tries": 1},
        "joints": joints,
        "backends": {"feetech": section},
    }
    path = folder / "arm" / "robot.yaml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(yaml.safe_dump(robot), encoding="utf-8")
    return path


@pytest.fixture
def bus() -> Iterator[StsBus]:
    servos = {number: Servo(angle=angle) for number, angle in ANGLES.items()}
    for servo in servos.values():
        servo.set("return_delay", 0)
    with StsBus(servos, seed=1) as bus:
        yield bus


@contextmanager
def served(bus: StsBus, folder: Path, **options: object) -> Iterator[Robot]:
    with open_robot(write_robot(folder, bus.port, **options)) as robot:
        yield robot


def until(condition: Callable[[], bool], what: str) -> None:
    assert wait_until(condition, WAIT_S, MonotonicClock()), what


def jumps(bus: StsBus) -> list[str]:
    """Goals of servos with torque that were far from the one before, at first from the servo."""
    found = []
    with bus.lock:
        for number, servo in bus.servos.items():
            before = None
            for step in list(servo.executed):
                if step.torque and before is not None:
                    first = not before.torque
                    origin = before.position if first else before.goal
                    elapsed_s = 0.1 if first else 0.06
                    if abs(step.goal - origin) > JUMP_TICKS + SPEED_TICKS_S * elapsed_s:
                        found.append(f"servo {number}: goal {origin} to {step.goal}")
                before = step
    return found


def move(robot: Robot, axis: int, target: float) -> None:
    robot.axes.move([Move(axis, target, Profile(1.0, 4.0, 4.0))])


def arrived(robot: Robot, axis: int, target: float) -> bool:
    return abs(float(robot.image.copy().position[axis]) - target) < 0.01


def test_it_switches_on_in_place_moves_and_switches_off(bus: StsBus, tmp_path: Path) -> None:
    with served(bus, tmp_path) as robot:
        assert robot.image.copy().servo_on.all()
        assert np.isnan(robot.image.copy().torque).all()  # a load is not a torque
        assert bus.arm[1].angle == pytest.approx(ANGLES[1], abs=0.01)
        move(robot, 0, 0.2)
        until(lambda: arrived(robot, 0, 0.2), "the move arrives")
        until(lambda: abs(bus.arm[1].angle - 0.2) < 0.005, "the shaft is there")
        assert bus.arm[2].angle == pytest.approx(ANGLES[2], abs=0.01)
    assert [bus[number].get("torque") for number in ANGLES] == [0, 0]
    assert jumps(bus) == []


@pytest.mark.parametrize("fault", ["drop", "corrupt", "truncate", "wrong_id", "noise"])
def test_lost_and_damaged_replies_end_nothing(bus: StsBus, tmp_path: Path, fault: str) -> None:
    with served(bus, tmp_path) as robot:
        move(robot, 0, 0.0)
        for servo in bus.servos.values():
            servo.faults.force(fault, 2)
        until(lambda: arrived(robot, 0, 0.0), "the move arrives")
        assert not robot.problems
    assert jumps(bus) == []


def test_an_echo_is_found_and_left_out(bus: StsBus, tmp_path: Path) -> None:
    bus.knobs.echo = True
    with served(bus, tmp_path) as robot:
        move(robot, 1, 1.0)
        until(lambda: arrived(robot, 1, 1.0), "the move arrives")


def _supply(bus: StsBus) -> None:
    bus[1].power_off()
    time.sleep(0.1)
    bus[1].power_on()


def _status(bus: StsBus) -> None:
    bus[1].supply_v = 3.0


def _stolen(bus: StsBus) -> None:
    for _ in range(50):  # a goal that is on its way switches the servo on again
        with bus.lock:
            bus[1].write(40, b"\x00")
        time.sleep(0.002)


@pytest.mark.parametrize(
    ("event", "code"),
    [(_supply, Fault.RESTARTED), (_status, 0x01), (_stolen, Fault.SWITCHED_OFF)],
)
def test_what_happens_in_motion_is_an_alarm_and_goes_on_in_place(
    event: Callable[[StsBus], None], code: int, bus: StsBus, tmp_path: Path
) -> None:
    with served(bus, tmp_path) as robot:
        move(robot, 0, 1.5)
        until(lambda: float(robot.image.copy().position[0]) > -0.2, "it moves")
        event(bus)
        until(lambda: bool(robot.image.copy().amp_alarm[0]), "the alarm is shown")
        assert robot.image.copy().alarm_code[0] == code
        with pytest.raises(NotReady):
            move(robot, 0, 0.0)
        bus[1].supply_v = 12.0
        bus.arm[1].move(0.7)  # by hand, with the servo off or without supply
        until(lambda: not robot.image.copy().offline[0], "the servo is back")
        robot.axes.clear_alarm(0)
        bus.arm[1].move(0.7)
        until(lambda: arrived(robot, 0, 0.7), "the hand is seen")
        time.sleep(0.2)
        robot.axes.servo(0, True)
        time.sleep(0.3)
        assert bus.arm[1].angle == pytest.approx(0.7, abs=0.02)
        move(robot, 0, 0.9)
        until(lambda: arrived(robot, 0, 0.9), "it moves again")
    assert jumps(bus) == []


def test_a_servo_that_went_off_gets_no_goal_that_switches_it_on(
    bus: StsBus, tmp_path: Path
) -> None:
    with served(bus, tmp_path) as robot:
        move(robot, 0, 1.5)
        time.sleep(0.3)
        robot.axes.servo(0, False)
        count = len(bus[1].writes)
        time.sleep(0.5)
        late = [write for write in list(bus[1].writes)[count:] if write.address >= 40]
        assert late == []
        assert bus[1].get("torque") == 0


def test_a_port_that_is_unplugged_ends_motion_and_opens_again(bus: StsBus, tmp_path: Path) -> None:
    with served(bus, tmp_path) as robot:
        move(robot, 0, 1.5)
        time.sleep(0.3)
        bus.unplug()
        until(lambda: "port lost" in robot.connection.fault, "the loss is named")
        stood = bus.arm[1].angle
        bus.plug_in()
        robot.recover()
        time.sleep(0.3)
        assert bus.arm[1].angle == pytest.approx(stood, abs=0.2)
    assert jumps(bus) == []


def test_parts_that_are_wrong_are_named_together(bus: StsBus, tmp_path: Path) -> None:
    bus[1].set("phase", 0x1C)
    bus[2].power_off()
    with pytest.raises(ConnectError) as caught, served(bus, tmp_path):
        pass
    text = str(caught.value)
    assert "joint1: servo 1 counts beyond one turn (register 18, bit 4)" in text
    assert "joint2: servo 2 does not answer" in text


def test_a_second_program_on_the_port_is_refused(bus: StsBus, tmp_path: Path) -> None:
    with (
        served(bus, tmp_path),
        pytest.raises(ConnectError, match="only one program"),
        opened(sts_bus.StsBus, bus.port, 1_000_000),
    ):
        pass


def test_two_servos_with_one_id_are_named() -> None:
    servos = {1: Servo(id=5, angle=0.3), 2: Servo(id=5, angle=-1.0)}
    with StsBus(servos) as bus, opened(sts_bus.StsBus, bus.port, 1_000_000, 0.05) as own:
        (found,) = scan_servos(own, [5])
    assert "two servos with this id" in found.remark


def test_a_scan_becomes_a_robot(
    bus: StsBus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bus_scan, "LAST_ID", 4)
    monkeypatch.setattr(bus_scan, "REPLY_TIMEOUT_S", 0.05)
    scan = ["feetech", "scan", "--port", bus.port, "--json"]
    result = CliRunner().invoke(main, scan)
    assert result.exit_code == 0, result.output
    assert [axis["servo"] for axis in json.loads(result.output)["axes"]] == [1, 2]
    new = ["new-robot", "axes", "--bus", f"feetech:{bus.port}", "--into", str(tmp_path)]
    result = CliRunner().invoke(main, new)
    assert "axes is a robot" in result.output or "is a robot: robot.yaml" in result.output
    robot = yaml.safe_load((tmp_path / "axes" / "robot.yaml").read_text())
    assert robot["backends"]["feetech"]["port"] == bus.port
    assert [joint["name"] for joint in robot["joints"]] == ["servo1", "servo2"]


def test_a_calibration_by_hand_is_in_servos_and_file(bus: StsBus, tmp_path: Path) -> None:
    for servo in bus.servos.values():
        servo.knobs.zero_after_save_s = 0.3
        servo.set("torque", 1)
    robot, file = str(write_robot(tmp_path, bus.port)), tmp_path / "arm.json"
    with closing(Terminal("calibrate", "--robot", robot, "--file", str(file))) as terminal:
        terminal.expect("support it. Go on")
        assert [bus[number].get("torque") for number in ANGLES] == [1, 1]
        bus.arm.move(ANGLES)
        terminal.answer("y")
        terminal.expect("middle of its range, then press Enter")
        terminal.answer("")
        terminal.expect("end to the other, then press Enter")
        for turn, ticks in ((-0.8, 2047 - 522), (1.1, 2047 + 717)):
            bus.arm.move({number: angle + turn for number, angle in ANGLES.items()})
            for joint in ("joint1", "joint2"):
                terminal.expect_row(joint, ticks)
        terminal.answer("")
        terminal.expect("is written")
        assert terminal.process.wait(WAIT_S) == 0
    bus.arm.move(ANGLES)
    options = {"calibration": str(file)}
    with served(bus, tmp_path, **options) as calibrated:
        image = calibrated.image.copy()
        # The middle of the sweep is zero: 0.15 rad above the pose of the calibration.
        assert image.position == pytest.approx([-0.15, -0.15], abs=0.004)
    bus[1].power_off()
    bus[1].power_on()
    time.sleep(1.0)
    bus[2].set("offset", 7)
    with pytest.raises(RobotdError, match="has the offset 7"), served(bus, tmp_path, **options):
        pass


def test_a_calibration_that_ends_after_the_middle_names_the_servos_with_new_offsets(
    bus: StsBus, tmp_path: Path
) -> None:
    robot, file = str(write_robot(tmp_path, bus.port)), tmp_path / "arm.json"
    arguments = ("calibrate", "--robot", robot, "--file", str(file), "--yes")
    advice = "joint1, joint2 have new offsets"
    with closing(Terminal(*arguments)) as terminal:
        terminal.expect("middle of its range, then press Enter")
        terminal.process.send_signal(signal.SIGINT)
        assert terminal.process.wait(WAIT_S) == 130
        assert "new offsets" not in terminal.shown
    with closing(Terminal(*arguments)) as terminal:
        terminal.expect("middle of its range, then press Enter")
        terminal.answer("")
        terminal.expect("end to the other, then press Enter")
        terminal.process.send_signal(signal.SIGINT)
        terminal.expect(advice)
        assert terminal.process.wait(WAIT_S) == 130
    assert not file.exists()


def test_a_leader_stays_free(bus: StsBus, tmp_path: Path) -> None:
    with served(bus, tmp_path, free=True) as robot:
        bus.arm[1].move(0.4)
        until(lambda: arrived(robot, 0, 0.4), "the hand is seen")
        with pytest.raises(RobotdError):
            move(robot, 0, 0.0)
        assert [bus[number].get("torque") for number in ANGLES] == [0, 0]
    assert not any(write.torque for servo in bus.servos.values() for write in servo.writes)


def test_an_arm_is_led_without_torque_and_held_where_it_was_left(
    bus: StsBus, tmp_path: Path
) -> None:
    with served(bus, tmp_path) as robot:
        robot.axes.begin_guiding([0, 1])
        assert [bus[number].get("torque") for number in ANGLES] == [0, 0]
        for _ in range(20):
            bus.arm[1].move(bus.arm[1].angle + 0.02)  # by hand
            time.sleep(0.01)
        led = ANGLES[1] + 0.4
        until(lambda: arrived(robot, 0, led), "the position follows the hand")
        with pytest.raises(NotReady, match="in use by hand guiding"):
            move(robot, 0, 0.0)
        robot.axes.stop_and_wait([0, 1], WAIT_S)
        until(lambda: bool(robot.image.copy().servo_on.all()), "the servos hold")
        assert bus.arm[1].angle == pytest.approx(led, abs=0.02)
        assert bus.arm[2].angle == pytest.approx(ANGLES[2], abs=0.02)
        move(robot, 0, 0.0)
        until(lambda: arrived(robot, 0, 0.0), "the move arrives")
    assert jumps(bus) == []


def test_the_end_of_robotd_switches_a_guided_arm_off(bus: StsBus, tmp_path: Path) -> None:
    with served(bus, tmp_path) as robot:
        robot.axes.begin_guiding([0, 1])
    assert [bus[number].get("torque") for number in ANGLES] == [0, 0]
    assert jumps(bus) == []


def test_an_arm_that_was_guided_when_its_port_was_lost_comes_on_again(
    bus: StsBus, tmp_path: Path
) -> None:
    with served(bus, tmp_path) as robot:
        robot.axes.begin_guiding([0, 1])
        bus.unplug()
        until(lambda: "port lost" in robot.connection.fault, "the loss is named")
        bus.plug_in()
        robot.recover()
        until(lambda: bool(robot.image.copy().servo_on.all()), "the servos are on again")
    assert jumps(bus) == []
