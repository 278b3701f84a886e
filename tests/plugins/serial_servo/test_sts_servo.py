"""The simulated STS servo by itself, in simulated time."""

from __future__ import annotations

import math

import pytest
from tests.plugins.serial_servo.joints import STEP_RAD, Joint
from tests.plugins.serial_servo.sts_servo import CURRENT, OVERLOAD, TEMPERATURE, VOLTAGE, Servo


class Bench:
    """A servo with a clock and writes by name."""

    def __init__(self, **arguments: object) -> None:
        self.servo = Servo(**arguments)  # type: ignore[arg-type]
        self.servo.start(0.0)

    def wait(self, seconds: float) -> None:
        self.servo.advance(self.servo.now + seconds)

    def write(self, name: str, value: int) -> None:
        register = self.servo.registers.by_name[name]
        self.servo.write(register.address, register.encode(value))

    def read(self, name: str) -> int:
        register = self.servo.registers.by_name[name]
        return register.decode(self.servo.read(register.address, register.size))

    def power_cycle(self) -> None:
        self.servo.power_off()
        self.wait(0.1)
        self.servo.power_on()
        self.wait(1.0)


# Goals


def test_torque_on_drives_to_goal_register_0_of_power_on() -> None:
    bench = Bench()
    bench.wait(0.1)
    assert (bench.read("goal_position"), bench.read("torque")) == (0, 0)
    bench.write("torque", 1)
    bench.wait(2.0)
    assert bench.read("position") == pytest.approx(0, abs=2)


def test_goal_write_energises_and_moves_after_the_dead_time() -> None:
    bench = Bench()
    bench.wait(0.1)
    bench.write("goal_position", 2500)
    assert bench.read("torque") == 1
    assert bench.servo.writes[-1][1:] == (42, "goal_position", 2500, True, 2500, 2048)
    bench.wait(1.0)
    begun = next(step for step in bench.servo.executed if step.position > 2050)
    assert 0.19 < begun.time_s < 0.22
    assert bench.read("position") == pytest.approx(2500, abs=2)
    assert bench.servo.joint.angle == pytest.approx(452 * STEP_RAD, abs=0.005)
    assert bench.servo.executed[-1].target == 2500


def test_goal_write_without_torque_by_knob() -> None:
    bench = Bench()
    bench.servo.knobs.goal_write_energises = False
    bench.write("goal_position", 2500)
    bench.wait(0.5)
    assert (bench.read("torque"), bench.read("position")) == (0, 2048)
    bench.servo.knobs.torque_on_target = "present"
    bench.write("torque", 1)
    bench.wait(0.5)
    assert bench.read("position") == 2048


def test_speed_and_acceleration_registers_limit_a_move() -> None:
    bench = Bench()
    bench.write("acceleration", 10)
    bench.write("goal_speed", 500)
    bench.write("goal_position", 3048)
    bench.wait(1.2)
    assert bench.read("speed") == pytest.approx(500, abs=5)
    bench.wait(2.0)
    assert max(step.velocity for step in bench.servo.executed) <= 505
    ramp = [step.time_s for step in bench.servo.executed if 50 < step.velocity < 450][0:1]
    full = [step.time_s for step in bench.servo.executed if step.velocity > 450][0:1]
    assert full[0] - ramp[0] == pytest.approx(0.4, abs=0.05)
    assert bench.read("moving") == 0


def test_goal_is_limited_by_angle_registers_and_keeps_its_value() -> None:
    bench = Bench(registers={"min_angle": 1000, "max_angle": 2200})
    bench.write("goal_position", 3000)
    bench.wait(1.0)
    assert bench.read("position") == pytest.approx(2200, abs=2)
    assert bench.read("goal_position") == 3000


# Torque


def test_torque_limit_is_copied_at_power_on_and_0_gives_no_output() -> None:
    bench = Bench(registers={"max_torque": 500})
    assert bench.read("torque_limit") == 500
    bench.write("torque_limit", 0)
    bench.write("goal_position", 3000)
    bench.wait(1.0)
    assert (bench.read("position"), bench.read("load")) == (2048, 0)
    bench.write("torque_limit", 300)
    bench.wait(0.1)
    assert bench.read("load") == 300


def test_overload_latches_until_torque_off() -> None:
    bench = Bench(registers={"protection_time": 35, "overload_torque": 36})
    bench.servo.joint.hold()
    bench.write("goal_position", 1000)
    bench.wait(0.4)
    assert bench.read("status") == 0
    assert bench.read("load") == -1000
    bench.wait(0.2)
    assert bench.read("status") == OVERLOAD
    assert (bench.read("torque"), bench.read("load")) == (1, -200)
    bench.servo.joint.release()
    bench.wait(0.1)
    assert bench.read("status") == OVERLOAD
    bench.write("torque", 0)
    bench.wait(0.1)
    assert bench.read("status") == 0


@pytest.mark.parametrize("clears", ["torque_off", "new_goal", "power_on"])
def test_overload_is_cleared_by_knob(clears: str) -> None:
    bench = Bench(registers={"protection_time": 10})
    bench.servo.knobs.overload_clears = clears
    bench.servo.joint.hold()
    bench.write("goal_position", 1000)
    bench.wait(0.5)
    bench.write("goal_position", 2048)
    bench.wait(0.1)
    assert (bench.read("status") == 0) is (clears == "new_goal")
    bench.write("torque", 0)
    bench.wait(0.1)
    assert (bench.read("status") == 0) is (clears != "power_on")
    bench.power_cycle()
    assert bench.read("status") == 0


def test_overload_can_silence_until_power_on() -> None:
    bench = Bench(registers={"protection_time": 10})
    bench.servo.knobs.overload_silences = True
    bench.servo.joint.hold()
    bench.write("goal_position", 1000)
    bench.wait(0.5)
    assert not bench.servo.answering
    bench.power_cycle()
    assert bench.servo.answering


def test_overcurrent_switches_the_output_off() -> None:
    bench = Bench(registers={"protection_current": 300, "overcurrent_time": 20})
    bench.servo.joint.hold()
    bench.write("goal_position", 1000)
    bench.wait(0.5)
    assert bench.read("status") == CURRENT
    assert bench.read("load") == 0


def test_supply_and_temperature_set_error_bits() -> None:
    bench = Bench()
    bench.servo.supply_v = 15.0
    bench.wait(0.1)
    assert (bench.read("status"), bench.read("voltage")) == (VOLTAGE, 150)
    bench.servo.supply_v = 12.0
    bench.servo.temperature_c = 75.0
    bench.write("goal_position", 3000)
    bench.wait(0.5)
    assert (bench.read("status"), bench.read("position")) == (TEMPERATURE, 2048)


def test_joint_falls_without_torque_and_is_held_with_it() -> None:
    bench = Bench(joint=Joint(0.5, load_nm=-1.0, lower=-0.3))
    bench.write("goal_position", bench.read("position"))
    bench.wait(0.5)
    held = bench.servo.joint.angle
    assert held == pytest.approx(0.5 - 1.0 / 15, abs=0.01)
    bench.write("torque", 0)
    bench.wait(2.0)
    assert bench.servo.joint.angle == -0.3


# Position


@pytest.mark.parametrize("offset", [900, -900])
def test_offset_is_subtracted_with_sign_bit_11(offset: int) -> None:
    bench = Bench(registers={"offset": offset})
    assert bench.servo.read(31, 2) == (900 | (0x800 if offset < 0 else 0)).to_bytes(2, "little")
    assert bench.read("position") == 2048 - offset


def test_position_wraps_within_a_turn() -> None:
    bench = Bench(registers={"offset": 904}, angle=(628 - 2048) * STEP_RAD)
    assert bench.read("position") == 3820


def test_hand_over_the_seam_jumps_and_phase_bit_4_counts_on() -> None:
    bench = Bench(angle=math.pi - 10 * STEP_RAD)
    assert bench.read("position") == 4086
    bench.servo.joint.move(math.pi + 10 * STEP_RAD)
    assert bench.read("position") == 10
    bench.write("phase", 12 | 16)
    bench.wait(0.1)
    assert bench.read("position") == 4106
    bench.servo.joint.move(-math.pi - 10 * STEP_RAD)
    assert bench.read("position") == -10


def test_128_makes_the_present_position_2048() -> None:
    bench = Bench(angle=0.7)
    bench.write("torque", 128)
    bench.wait(0.1)
    assert bench.read("position") == 2048
    assert bench.read("offset") == round(0.7 / STEP_RAD)
    assert bench.read("torque") == 0


def test_position_can_be_0_right_after_a_persistent_write() -> None:
    bench = Bench()
    bench.write("position_p", 16)
    assert bench.read("position") == 2048
    bench.servo.knobs.zero_after_save_s = 0.02
    bench.write("position_p", 16)
    assert bench.read("position") == 0
    bench.wait(0.03)
    assert bench.read("position") == 2048


def test_lock_decides_what_survives_a_loss_of_power() -> None:
    bench = Bench()
    bench.write("offset", 100)
    bench.write("lock", 0)
    bench.write("position_p", 16)
    bench.wait(0.1)
    assert bench.read("position") == 1948
    bench.power_cycle()
    assert (bench.read("offset"), bench.read("position_p")) == (0, 16)
    assert bench.read("lock") == 1


def test_loss_of_power_takes_torque_turns_and_ram() -> None:
    bench = Bench(registers={"phase": 28, "min_angle": 0, "max_angle": 0})
    bench.write("goal_position", 6000)
    bench.wait(3.0)
    assert bench.read("position") == pytest.approx(6000, abs=2)
    bench.power_cycle()
    assert bench.read("position") == pytest.approx(6000 - 4096, abs=2)
    assert (bench.read("torque"), bench.read("goal_position")) == (0, 0)


def test_backlash_delays_a_reversal() -> None:
    def reversal_s(play_rad: float) -> float:
        bench = Bench()
        bench.servo.motor.data.play_rad = play_rad
        bench.write("goal_speed", 200)
        bench.write("goal_position", 2300)
        bench.wait(2.0)
        bench.write("goal_position", 2100)
        begun = bench.servo.now
        bench.wait(1.0)
        return next(
            step.time_s - begun
            for step in bench.servo.executed
            if step.time_s > begun and step.velocity < -50
        )

    assert reversal_s(0.04) > reversal_s(0.0) + 0.04


# Other modes


def test_velocity_mode_energises_by_speed_0_and_turns_on() -> None:
    bench = Bench(registers={"mode": 1})
    bench.write("goal_speed", 0)
    assert bench.read("torque") == 1
    bench.write("goal_speed", -800)
    bench.wait(1.5)
    assert bench.read("speed") == pytest.approx(-800, abs=20)
    assert bench.servo.joint.angle < -1.0


def test_pwm_mode_uses_sign_bit_10() -> None:
    bench = Bench(registers={"mode": 2})
    bench.write("torque", 1)
    bench.servo.write(44, (300 | 0x400).to_bytes(2, "little"))
    bench.wait(0.5)
    assert bench.read("load") == -300


def test_step_mode_adds_each_goal() -> None:
    bench = Bench(registers={"mode": 3, "min_angle": 0, "max_angle": 0})
    for _ in range(2):
        bench.write("goal_position", -200)
        bench.wait(1.0)
    assert bench.read("position") == pytest.approx(1648, abs=3)
