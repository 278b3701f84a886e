"""The simulated Dynamixel X servo by itself, in simulated time."""

from __future__ import annotations

import math

import pytest
from tests.plugins.serial_servo.dxl_servo import (
    ACCESS,
    HEAT,
    INSTRUCTION,
    LENGTH,
    LIMIT,
    OVERLOAD,
    RANGE,
    RESULT_FAIL,
    VELOCITY_UNIT,
    VOLTAGE,
    Servo,
)
from tests.plugins.serial_servo.joints import STEP_RAD


class Bench:
    """A servo with a clock and writes by name."""

    def __init__(self, model: str = "xl430-w250", **arguments: object) -> None:
        self.servo = Servo(model, **arguments)  # type: ignore[arg-type]
        self.servo.start(0.0)

    def wait(self, seconds: float) -> None:
        self.servo.advance(self.servo.now + seconds)

    def write(self, name: str, value: int) -> int:
        register = self.servo.registers.by_name[name]
        return self.servo.write(register.address, register.encode(value))

    def read(self, name: str) -> int:
        register = self.servo.registers.by_name[name]
        return register.decode(self.servo.read(register.address, register.size))


@pytest.mark.parametrize("model", ["xl430-w250", "xm430-w350", "xl330-m288", "xl330-m077"])
def test_moves_to_its_goal_and_carries_a_load(model: str) -> None:
    bench = Bench(model, angle=0.2)
    assert bench.read("goal_position") == bench.read("position") == 2048 + 130
    assert bench.write("torque", 1) == 0
    assert bench.write("goal_position", 1000) == 0
    bench.wait(3.0)
    assert bench.read("position") == pytest.approx(1000, abs=2)
    bench.servo.joint.load_nm = bench.servo.motor.data.stall_nm / 4
    bench.wait(0.5)
    assert 1000 < bench.read("position") < 1500
    assert bench.read("load") < 0


def test_torque_on_drives_to_the_goal_from_before() -> None:
    bench = Bench()
    bench.servo.joint.move(0.5)
    bench.write("torque", 1)
    bench.wait(1.0)
    assert bench.read("position") == pytest.approx(2048, abs=2)
    bench.write("torque", 0)
    bench.servo.joint.move(0.5)
    bench.servo.knobs.torque_on_target = "present"
    bench.write("torque", 1)
    bench.wait(1.0)
    assert bench.read("position") == pytest.approx(2048 + 326, abs=2)


def test_drive_mode_lets_a_goal_switch_torque_on() -> None:
    bench = Bench()
    bench.write("goal_position", 2500)
    assert bench.read("torque") == 0
    bench.write("drive_mode", 8)
    bench.write("goal_position", 2600)
    assert bench.read("torque") == 1
    bench.wait(1.0)
    assert bench.read("position") == pytest.approx(2600, abs=2)


def test_errors_of_writes() -> None:
    bench = Bench()
    assert bench.write("mode", 5) == RANGE
    assert bench.write("torque", 2) == RANGE
    assert bench.write("goal_position", 5000) == LIMIT
    assert bench.write("goal_velocity", 266) == LIMIT
    assert bench.write("position", 1) == ACCESS
    assert bench.servo.write(300, b"\1") == ACCESS
    assert bench.servo.write(116, b"\1\0") == LENGTH
    assert bench.servo.act() == INSTRUCTION
    bench.write("torque", 1)
    assert bench.write("homing_offset", 1) == ACCESS
    assert not [item for item in bench.servo.writes if item.name != "torque"]
    assert Bench("xm430-w350").write("mode", 5) == 0


def test_velocity_profile_limits_speed_and_acceleration() -> None:
    bench = Bench()
    bench.write("torque", 1)
    bench.write("profile_velocity", 40)
    bench.write("profile_acceleration", 5)
    bench.write("goal_position", 3500)
    bench.wait(0.25)
    assert bench.read("velocity") == pytest.approx(0.225 * 1220 / VELOCITY_UNIT, abs=3)
    bench.wait(1.0)
    assert bench.read("velocity") == pytest.approx(40, abs=1)
    assert bench.read("moving_status") & 3 == 2
    bench.wait(3.0)
    assert (bench.read("moving_status"), bench.read("moving")) == (1, 0)


def test_time_profile_takes_its_time_for_any_distance() -> None:
    bench = Bench()
    bench.write("drive_mode", 4)
    bench.write("torque", 1)
    bench.write("profile_velocity", 1000)
    bench.write("profile_acceleration", 200)
    for goal in (2200, 3500):
        bench.write("goal_position", goal)
        bench.wait(0.85)
        assert abs(bench.read("position") - goal) > 5
        bench.wait(0.35)
        assert bench.read("position") == pytest.approx(goal, abs=2)


def test_bus_watchdog_stops_and_locks_the_goals() -> None:
    bench = Bench()
    bench.write("bus_watchdog", 5)
    bench.wait(0.5)
    assert bench.read("bus_watchdog") == 5
    bench.write("torque", 1)
    bench.write("profile_velocity", 40)
    bench.write("goal_position", 4000)
    bench.wait(0.08)
    bench.servo.notice_instruction()
    bench.wait(0.08)
    assert bench.read("bus_watchdog") == 5
    bench.wait(0.1)
    assert bench.read("bus_watchdog") == -1
    stopped = bench.read("position")
    assert bench.write("goal_position", 2000) == RANGE
    bench.wait(0.5)
    assert bench.read("position") == pytest.approx(stopped, abs=10)
    assert bench.read("torque") == 1
    assert bench.write("bus_watchdog", 0) == 0
    assert bench.write("goal_position", 2000) == 0
    bench.wait(2.0)
    assert bench.read("position") == pytest.approx(2000, abs=2)


def test_shutdown_needs_a_reboot_which_loses_ram() -> None:
    bench = Bench()
    bench.write("position_p", 800)
    bench.write("torque", 1)
    bench.servo.joint.hold()
    bench.write("goal_position", 3000)
    bench.wait(2.0)
    assert (bench.read("hardware_error"), bench.read("torque")) == (OVERLOAD, 0)
    assert bench.servo.alert == 0x80
    bench.write("torque", 1)
    assert bench.read("torque") == 0
    bench.servo.joint.release()
    bench.servo.reboot()
    assert not bench.servo.answering
    bench.wait(0.5)
    assert bench.servo.answering
    assert (bench.read("hardware_error"), bench.read("position_p")) == (0, 640)
    bench.write("torque", 1)
    assert bench.read("torque") == 1


def test_errors_outside_the_shutdown_mask_only_alert() -> None:
    bench = Bench()
    bench.write("torque", 1)
    bench.servo.supply_v = 15.0
    bench.wait(0.1)
    assert (bench.read("hardware_error"), bench.read("torque")) == (VOLTAGE, 1)
    bench.servo.temperature_c = 90
    bench.wait(0.1)
    assert (bench.read("hardware_error"), bench.read("torque")) == (VOLTAGE | HEAT, 0)


def test_homing_offset_is_added_and_reverse_mirrors() -> None:
    bench = Bench(angle=100 * STEP_RAD)
    bench.write("homing_offset", 50)
    assert bench.read("position") == 2198
    bench.write("drive_mode", 1)
    assert bench.read("position") == 1998
    bench.write("homing_offset", 2000)
    assert bench.read("position") == 1948
    bench.write("homing_offset", 0)
    bench.write("torque", 1)
    bench.write("goal_position", 1800)
    bench.wait(1.0)
    assert bench.read("position") == pytest.approx(1800, abs=2)
    assert bench.servo.joint.angle == pytest.approx(248 * STEP_RAD, abs=0.005)


def test_turns_are_counted_and_lost_as_documented() -> None:
    bench = Bench()
    bench.servo.joint.move(4 * math.pi)
    assert bench.read("position") == 2048 + 8192
    bench.write("mode", 4)
    bench.write("torque", 1)
    assert bench.read("position") == 2048 + 8192
    bench.write("goal_position", 4000)
    assert bench.servo.clear_turns() == 0
    bench.wait(0.1)
    assert bench.servo.clear_turns() == RESULT_FAIL
    bench.wait(2.0)
    assert bench.read("position") == pytest.approx(4000, abs=2)
    bench.write("torque", 0)
    bench.write("mode", 3)
    bench.servo.joint.move(2 * math.pi)
    assert bench.read("position") not in range(4096)
    bench.write("torque", 1)
    assert bench.read("position") == 2048


def test_current_limits_the_current_based_position_mode() -> None:
    bench = Bench("xl330-m288")
    bench.write("mode", 5)
    bench.write("torque", 1)
    bench.write("goal_current", 300)
    bench.servo.joint.hold()
    bench.write("goal_position", 3000)
    bench.wait(0.5)
    assert bench.read("load") == 300
    bench.write("goal_current", -200)
    bench.wait(0.1)
    assert bench.read("load") == 200


def test_velocity_and_pwm_modes() -> None:
    bench = Bench()
    bench.write("mode", 1)
    bench.write("torque", 1)
    bench.write("goal_velocity", -50)
    bench.wait(1.0)
    assert bench.read("velocity") == pytest.approx(-50, abs=1)
    bench.write("torque", 0)
    bench.write("mode", 16)
    assert bench.read("goal_pwm") == 885
    bench.write("torque", 1)
    bench.write("goal_pwm", 200)
    bench.wait(0.2)
    assert bench.read("pwm") == 200


def test_indirect_data_is_what_it_points_to() -> None:
    bench = Bench()
    for index in range(4):
        bench.write(f"indirect_address_{index + 1}", 116 + index)
        bench.write(f"indirect_address_{index + 5}", 132 + index)
        bench.write(f"indirect_address_{index + 29}", 128 + index)
    assert bench.servo.write(224, (2500).to_bytes(4, "little")) == 0
    assert bench.read("goal_position") == 2500
    assert bench.servo.read(228, 4) == (2048).to_bytes(4, "little")
    assert bench.servo.read(634, 4) == bytes(4)
    assert bench.servo.write(224, b"\1\2") == LENGTH
    assert bench.servo.write(228, bytes(4)) == ACCESS
    assert bench.write("indirect_address_1", 20) == RANGE
