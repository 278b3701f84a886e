"""The backend on the simulated bus, judged by what its servos have executed, in real time."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from tests.plugins.serial_servo.dxl_bus import DxlBus
from tests.plugins.serial_servo.dxl_servo import Servo

from robotd import ConnectError, NotReady, Robot, open_robot
from robotd.api import MonotonicClock, Profile, wait_until
from robotd.api.robots import Move
from robotd.cli.main import main
from robotd_dynamixel import dynamixel_bus
from robotd_dynamixel.dynamixel_bus import DynamixelBus
from robotd_serial_servo import bus_scan
from robotd_serial_servo.bus_scan import opened, scan_servos
from robotd_serial_servo.calibration import write_calibration
from robotd_serial_servo.hand_calibration import (
    calibrations,
    positions,
    release_all,
    store_all,
    store_middle,
)
from robotd_serial_servo.servo_bus import BusError, Goal
from robotd_serial_servo.servo_faults import Fault

ANGLES = {1: -0.5, 2: 0.9}
SPEED_TICKS_S = 1304 * 1.2  # 2 rad/s, and the margin of the last line of defence
JUMP_TICKS = 30
WAIT_S = 30.0
WATCHDOG_S = 2.0
WATCHDOG = 100  # in its register


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
        "backend": "dynamixel",
        "cycle": {"rate_hz": 80},
        "engine": {"stale_after_s": 5.0, "open_tries": 1},
        "joints": joints,
        "backends": {"dynamixel": section},
    }
    path = folder / "arm" / "robot.yaml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(yaml.safe_dump(robot), encoding="utf-8")
    return path


@pytest.fixture
def bus() -> Iterator[DxlBus]:
    models = {1: "xl430-w250", 2: "xl330-m288"}
    servos = {number: Servo(models[number], angle=angle) for number, angle in ANGLES.items()}
    for servo in servos.values():
        servo.set("return_delay", 0)
    with DxlBus(servos, seed=1) as bus:
        yield bus


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the watchdogs of the servos outlast the stalls of a busy computer."""
    monkeypatch.setattr(dynamixel_bus, "STOPS_AFTER_S", WATCHDOG_S)


@pytest.fixture
def own(bus: DxlBus) -> Iterator[DynamixelBus]:
    with opened(DynamixelBus, bus.port, 1_000_000, 0.3) as own:
        assert isinstance(own, DynamixelBus)
        yield own


@contextmanager
def served(bus: DxlBus, folder: Path, **options: object) -> Iterator[Robot]:
    with open_robot(write_robot(folder, bus.port, **options)) as robot:
        yield robot


def until(condition: Callable[[], bool], what: str) -> None:
    assert wait_until(condition, WAIT_S, MonotonicClock()), what


def jumps(bus: DxlBus) -> list[str]:
    """Goals of servos with torque that were far from the one before, at first from the servo."""
    found = []
    with bus.lock:
        for number, servo in bus.servos.items():
            before = None
            for step in list(servo.executed):
                if step.torque and before is not None:
                    origin = before.goal if before.torque else before.position
                    elapsed_s = 0.1  # for which a goal may catch up
                    if abs(step.goal - origin) > JUMP_TICKS + SPEED_TICKS_S * elapsed_s:
                        found.append(f"servo {number}: goal {origin} to {step.goal}")
                before = step
    return found


def move(robot: Robot, axis: int, target: float) -> None:
    robot.axes.move([Move(axis, target, Profile(1.0, 4.0, 4.0))])


def arrived(robot: Robot, axis: int, target: float) -> bool:
    return abs(float(robot.image.copy().position[axis]) - target) < 0.01


def test_a_servo_is_read_seeded_limited_and_switched(bus: DxlBus, own: DynamixelBus) -> None:
    identity = own.identify(1)
    assert (identity.model_name, identity.trouble) == ("xl430-w250", "")
    position = own.read([1])[1].position
    own.limit_torque(1, 0.5)
    own.seed(1, Goal(position, 1000))
    own.set_torque(1, on=True)
    state = own.read([1, 2])[1]
    assert state.torque
    assert state.goal == position
    assert state.torque_limit == pytest.approx(0.5, abs=0.002)
    assert bus[1].get("bus_watchdog") == WATCHDOG
    own.set_torque(1, on=False)
    assert bus[1].get("bus_watchdog") == 0
    assert not own.read([1])[1].restarted


def test_what_a_servo_rejects_is_named(bus: DxlBus, own: DynamixelBus) -> None:
    with pytest.raises(BusError, match=r"register 116 .* the value is beyond a limit"):
        own._write(1, 116, (5000).to_bytes(4, "little"))  # beyond its limits in position mode


@pytest.mark.parametrize(
    ("registers", "text"),
    [
        ({"mode": 1}, "is in velocity mode"),
        ({"homing_offset": 1500}, "which position mode ignores beyond ±1024"),
        ({"mode": 4, "homing_offset": 3000}, r"is at 4\d\d\d, which is \+1 turns off"),
        ({"firmware": 37}, "without a bus watchdog"),
        ({"drive_mode": 8}, "is switched on by any goal"),
        ({"pwm_limit": 100}, "has the PWM limit 100"),
    ],
)
def test_a_servo_that_cannot_be_driven_is_named(
    bus: DxlBus, own: DynamixelBus, registers: dict[str, int], text: str
) -> None:
    for name, value in registers.items():
        bus[1].set(name, value)
    (found,) = scan_servos(own, [1])
    assert re.search(text, found.remark), found.remark


@pytest.mark.long
def test_it_switches_on_in_place_moves_and_switches_off(bus: DxlBus, tmp_path: Path) -> None:
    for servo in bus.servos.values():
        servo.set("goal_position", 100)  # as of a program before
    with served(bus, tmp_path) as robot:
        assert robot.image.copy().servo_on.all()
        assert np.isnan(robot.image.copy().torque).all()  # a load is not a torque
        assert bus.arm[1].angle == pytest.approx(ANGLES[1], abs=0.01)
        for fault in ("drop", "corrupt", "truncate", "wrong_id", "noise"):
            bus[1].faults.force(fault, 2)
        move(robot, 0, 0.2)
        until(lambda: arrived(robot, 0, 0.2), "the move arrives")
        assert not robot.problems
        assert bus.arm[2].angle == pytest.approx(ANGLES[2], abs=0.01)
    assert [bus[number].get("torque") for number in ANGLES] == [0, 0]
    assert jumps(bus) == []


@pytest.mark.long
def test_profiles_in_milliseconds_are_not_taken_for_speeds(bus: DxlBus, tmp_path: Path) -> None:
    bus[1].set("drive_mode", 4)
    with served(bus, tmp_path) as robot:
        assert bus[1].get("profile_velocity") == 0
        assert bus[2].get("profile_velocity") > 0
        move(robot, 0, 0.0)
        until(lambda: arrived(robot, 0, 0.0), "the move arrives")
    assert jumps(bus) == []


def _supply(bus: DxlBus) -> None:
    bus[1].power_off()
    time.sleep(0.1)
    bus[1].power_on()


def _voltage(bus: DxlBus) -> None:
    bus[1].supply_v = 3.0


def _stolen(bus: DxlBus) -> None:
    with bus.lock:
        bus[1].write(64, b"\x00")


def _silent(bus: DxlBus) -> None:
    with bus.lock:
        bus[1].write(98, b"\x01")  # 20 ms
        bus[1].faults.lose_request = 1.0
    until(lambda: bus[1].get("bus_watchdog") == -1, "the watchdog expires")
    bus[1].faults.lose_request = 0.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("event", "code"),
    [
        (_supply, Fault.RESTARTED),
        (_voltage, 0x01),
        (_stolen, Fault.SWITCHED_OFF),
        (_silent, Fault.EXPIRED),
    ],
)
def test_what_happens_in_motion_is_an_alarm_and_goes_on_in_place(
    event: Callable[[DxlBus], None], code: int, bus: DxlBus, tmp_path: Path
) -> None:
    with served(bus, tmp_path) as robot:
        move(robot, 0, 1.5)
        until(lambda: float(robot.image.copy().position[0]) > -0.3, "it moves")
        event(bus)
        until(lambda: bool(robot.image.copy().amp_alarm[0]), "the alarm is shown")
        assert robot.image.copy().alarm_code[0] == code
        with pytest.raises(NotReady):
            move(robot, 0, 0.0)
        bus[1].supply_v = 12.0
        until(lambda: not robot.image.copy().offline[0], "the servo is back")
        robot.axes.clear_alarm(0)
        assert bus[1].get("torque") == 0
        bus.arm[1].move(0.7)
        until(lambda: arrived(robot, 0, 0.7), "the hand is seen")
        robot.axes.servo(0, True)
        assert bus[1].get("bus_watchdog") == WATCHDOG  # what a restart has lost is there again
        assert bus[1].get("profile_velocity") > 0
        move(robot, 0, 0.9)
        until(lambda: arrived(robot, 0, 0.9), "it moves again")
    assert jumps(bus) == []


@pytest.mark.long
def test_the_servos_stop_by_themselves_when_the_computer_is_silent(
    bus: DxlBus, own: DynamixelBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()
    assert dynamixel_bus.STOPS_AFTER_S == 0.2
    position = own.read([1])[1].position
    own.seed(1, Goal(position, 200))
    own.set_torque(1, on=True)
    own.write_goals({1: Goal(position + 1500, 200)})
    until(lambda: bus[1].get("bus_watchdog") == -1, "the watchdog expires")
    stood = bus.arm[1].angle
    time.sleep(0.3)
    assert bus.arm[1].angle == pytest.approx(stood, abs=0.02)
    state = own.read([1])[1]
    assert state.expired
    assert state.position < position + 400


def test_a_scan_becomes_a_robot(
    bus: DxlBus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bus_scan, "LAST_ID", 3)
    monkeypatch.setattr(bus_scan, "REPLY_TIMEOUT_S", 0.05)
    bus[2].set("return_delay", 250)
    result = CliRunner().invoke(main, ["dynamixel", "scan", "--port", bus.port, "--json"])
    assert result.exit_code == 0, result.output
    axes = json.loads(result.output)["axes"]
    assert [axis["model"] for axis in axes] == ["xl430-w250", "xl330-m288"]
    assert "replies 500 µs late" in axes[1]["remark"]
    new = ["new-robot", "axes", "--bus", f"dynamixel:{bus.port}", "--into", str(tmp_path)]
    result = CliRunner().invoke(main, new)
    assert result.exit_code == 0, result.output
    robot = yaml.safe_load((tmp_path / "axes" / "robot.yaml").read_text())
    assert robot["backends"]["dynamixel"]["port"] == bus.port


@pytest.mark.long
def test_a_calibration_is_in_servos_and_file_in_the_sense_of_lerobot(
    bus: DxlBus, own: DynamixelBus, tmp_path: Path
) -> None:
    joints = {"joint1": 1, "joint2": 2}
    bus.arm[2].move(-2.5)  # its offset does not fit into position mode
    raw = positions(own, [1, 2])
    release_all(own, joints)
    offsets, again = dict[str, int](), dict[str, int]()
    store_middle(own, joints, offsets)
    assert offsets == {joint: 2047 - raw[servo] for joint, servo in joints.items()}
    store_middle(own, joints, again)
    assert again == offsets
    assert [bus[1].get("mode"), bus[2].get("mode")] == [3, 4]
    assert positions(own, [1, 2]) == {1: 2047, 2: 2047}
    ranges = {"joint1": (1500, 2600), "joint2": (1400, 2700)}
    found = calibrations(joints, offsets, ranges)
    store_all(own, joints, found)
    own.close()
    write_calibration(tmp_path / "arm.json", found)
    file = {"calibration": str(tmp_path / "arm.json")}
    with served(bus, tmp_path, **file) as robot:
        assert robot.image.copy().position == pytest.approx([-0.0046, -0.0046], abs=0.003)
    bus[2].set("homing_offset", 7)
    with pytest.raises(ConnectError, match="has the offset 7"), served(bus, tmp_path, **file):
        pass
