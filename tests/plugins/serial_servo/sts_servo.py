"""Simulated Feetech STS servo: registers and behaviour, without a bus.

Written from the maker's memory table of the STS series, the maker's SDK, and from what users
measured on STS3215 with firmware 3.10. Names of registers are those of ``TABLE``.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import NamedTuple

from tests.plugins.serial_servo.joints import Joint
from tests.plugins.serial_servo.motor import MotorData
from tests.plugins.serial_servo.registers import Register
from tests.plugins.serial_servo.simulated_servo import SimulatedServo

TURN = 4096
BAUDS = (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)

VOLTAGE, ENCODER, TEMPERATURE, CURRENT, OVERLOAD = 0x01, 0x02, 0x04, 0x08, 0x20
"""Bits of the status register, which is the error byte of every reply."""

SPEED_IN_STEPS, ZERO_SPEED_IS_FASTEST, BEYOND_ONE_TURN = 0x04, 0x08, 0x10
"""Bits of the phase register."""

POSITION, VELOCITY, PWM, STEP = range(4)
OFF, ON, DAMPED, SET_MIDDLE = 0, 1, 2, 128

MODELS = {
    "sts3215": (777, MotorData()),
    "sts3250": (2825, MotorData(stall_nm=4.9, stiffness_nm_rad=25.0)),
}


def saved(address: int, size: int, name: str, default: int = 0, **kinds: object) -> Register:
    return Register(address, size, name, default, persistent=True, **kinds)  # type: ignore[arg-type]


def shown(address: int, size: int, name: str, **kinds: object) -> Register:
    return Register(address, size, name, writable=False, **kinds)  # type: ignore[arg-type]


TABLE = (
    saved(0, 1, "firmware_major", 3, writable=False),
    saved(1, 1, "firmware_minor", 10, writable=False),
    saved(3, 2, "model", 777, writable=False),
    saved(5, 1, "id", 1),
    saved(6, 1, "baud", 0),
    saved(7, 1, "return_delay", 250),
    saved(8, 1, "reply_level", 1),
    saved(9, 2, "min_angle", 0),
    saved(11, 2, "max_angle", 4095),
    saved(13, 1, "max_temperature", 70),
    saved(14, 1, "max_voltage", 140),
    saved(15, 1, "min_voltage", 40),
    saved(16, 2, "max_torque", 1000),
    saved(18, 1, "phase", SPEED_IN_STEPS | ZERO_SPEED_IS_FASTEST),
    saved(19, 1, "unload_conditions", 44),
    saved(20, 1, "led_conditions", 47),
    saved(21, 1, "position_p", 32),
    saved(22, 1, "position_d", 32),
    saved(23, 1, "position_i", 0),
    saved(24, 2, "start_force", 16),
    saved(26, 1, "dead_zone_cw", 1),
    saved(27, 1, "dead_zone_ccw", 1),
    saved(28, 2, "protection_current", 500),
    saved(30, 1, "angle_resolution", 1),
    saved(31, 2, "offset", 0, sign_bit=11),
    saved(33, 1, "mode", POSITION),
    saved(34, 1, "protective_torque", 20),
    saved(35, 1, "protection_time", 200),
    saved(36, 1, "overload_torque", 80),
    saved(37, 1, "velocity_p", 10),
    saved(38, 1, "overcurrent_time", 200),
    saved(39, 1, "velocity_i", 10),
    Register(40, 1, "torque", OFF),
    Register(41, 1, "acceleration", 0),
    Register(42, 2, "goal_position", 0, sign_bit=15),
    Register(44, 2, "goal_pwm", 0, sign_bit=10),
    Register(46, 2, "goal_speed", 0, sign_bit=15),
    Register(48, 2, "torque_limit", 1000),
    Register(55, 1, "lock", 1),
    shown(56, 2, "position", sign_bit=15),
    shown(58, 2, "speed", sign_bit=15),
    shown(60, 2, "load", sign_bit=10),
    shown(62, 1, "voltage"),
    shown(63, 1, "temperature"),
    shown(64, 1, "staged"),
    shown(65, 1, "status"),
    shown(66, 1, "moving"),
    shown(67, 2, "target", sign_bit=15),
    shown(69, 2, "current", sign_bit=15),
    saved(84, 1, "max_speed", 72, writable=False),
    saved(85, 1, "max_acceleration", 254, writable=False),
)

MOTION_REGISTERS = {"acceleration", "goal_position", "goal_pwm", "goal_speed"}


@dataclass(slots=True)
class StsKnobs:
    """Traits of one servo; each may change at any time."""

    dead_time_s: float = 0.09
    """Time from a goal to the start of motion."""
    goal_at_power_on: int | None = 0
    """Goal register after power-on, steps; None: the present position."""
    torque_at_power_on: bool = False
    torque_on_target: str = "goal"
    """Torque on by register 40: "goal" drives to the goal register, "present" stays."""
    goal_write_energises: bool = True
    """A goal position, or a goal speed in velocity mode, switches torque on."""
    overload_clears: str = "torque_off"
    """What ends an overload: "torque_off", "new_goal" (or torque off), or only "power_on"."""
    overload_silences: bool = False
    """An overloaded servo answers nothing until power-on."""
    zero_after_save_s: float = 0.0
    """Position is read as 0 for this time after a write to persistent registers. 0.02 breaks the
    calibration of LeRobot, which reads at once."""
    return_delay_works: bool = True
    """Register 7 delays replies; the maker's table says that it has no function on some STS."""
    encoder_fault: bool = False
    heats: bool = True
    """Temperature follows the output; False: it stays at ``temperature_c``."""
    boot_s: float = 0.8


class Command(NamedTuple):
    """Motion registers at one time, executed at ``due``."""

    due: float
    goal: int | None
    speed: int
    acceleration: int
    pwm: int


class Servo(SimulatedServo):
    """One STS servo.

    model: a key of ``MODELS``. angle: of the joint at the start, rad; 0 is encoder step 2048.
    registers: values of persistent registers, by name. id: None: that of its key on the bus.
    """

    def __init__(
        self,
        model: str = "sts3215",
        *,
        id: int | None = None,  # noqa: A002 - the maker's word
        angle: float = 0.0,
        joint: Joint | None = None,
        knobs: StsKnobs | None = None,
        registers: dict[str, int] | None = None,
    ) -> None:
        number, data = MODELS[model]
        super().__init__(TABLE, 256, replace(data), joint or Joint(angle))
        self.given_id = id
        self.knobs = knobs or StsKnobs()
        for name, value in {"model": number, **(registers or {})}.items():
            self.set(name, value)
        if id is not None:
            self.set("id", id)
        self._staged: tuple[int, bytes] | None = None
        self._overload_s = self._overcurrent_s = 0.0
        self._latched = 0
        self._commands: deque[Command] = deque()
        self._command: Command | None = None
        self._target = 0.0
        self._zero_until = 0.0
        self._first_turn = 0
        self.reset()

    # State

    @property
    def boot_s(self) -> float:
        return self.knobs.boot_s

    @property
    def output_on(self) -> bool:
        values = self.registers.values
        cut = values["status"] & values["unload_conditions"] & ~OVERLOAD
        return values["torque"] == ON and not cut

    @property
    def answering(self) -> bool:
        if self.knobs.overload_silences and self._latched & OVERLOAD:
            return False
        return self.powered and self.now >= self._booted_at

    def reset(self) -> None:
        self.registers.load()
        self.set("torque_limit", self.get("max_torque"))
        self._first_turn = math.floor(self.encoder / TURN) * TURN
        goal = self.knobs.goal_at_power_on
        self.set("goal_position", self.reported() if goal is None else goal)
        self._staged = self._command = None
        self._commands.clear()
        self._latched, self._overload_s, self._overcurrent_s = 0, 0.0, 0.0
        if self.knobs.torque_at_power_on:
            self._switch(ON)

    def reported(self) -> int:
        """Return the position after the offset: within one turn, or counted on by phase bit 4."""
        values = self.registers.values
        position = round(self.encoder) - values["offset"]
        if values["phase"] & BEYOND_ONE_TURN:
            return position - self._first_turn
        return position % TURN

    def return_delay_s(self) -> float:
        return self.get("return_delay") * 2e-6 if self.knobs.return_delay_works else 0.0

    # Requests

    def read(self, address: int, count: int) -> bytes:
        self._refresh()
        return bytes(self.registers.memory[address : address + count]).ljust(count, b"\0")

    def write(self, address: int, data: bytes) -> None:
        """Write a block; read-only and undefined bytes of it are ignored."""
        written = [item for item in self.registers.touched(address, len(data)) if item.writable]
        for register in written:
            save = register.persistent and not self.get("lock")
            self.registers.store(register, address, data, save=save)
        names = {item.name for item in written}
        if any(item.persistent for item in written):
            self._zero_until = self.now + self.knobs.zero_after_save_s
        if "torque" in names:
            self._switch(self.get("torque"))
        if names & MOTION_REGISTERS:
            self._take_motion(names)
        self.record_writes(written)

    def stage(self, address: int, data: bytes) -> None:
        self._staged = (address, data)

    def act(self) -> None:
        staged, self._staged = self._staged, None
        if staged is not None:
            self.write(*staged)

    def restore_factory_settings(self) -> None:
        """Restore all settings but id and model."""
        servo_id, model = self.id, self.get("model")
        self.registers.restore_factory_settings()
        self.set("id", servo_id)
        self.set("model", model)
        self.reset()

    def _switch(self, value: int) -> None:
        if value == SET_MIDDLE:
            # The register keeps its state [unknown]; a servo with torque then moves to its goal.
            offset = round(self.encoder) % TURN - TURN // 2
            self.set("offset", offset)
            self.set("torque", ON if self._command or self._commands else OFF)
            return
        self.set("torque", value)
        if value == ON:
            if self._command is None and not self._commands:
                self._energise()
                if self.knobs.torque_on_target == "goal":
                    self._queue(self.get("goal_position"))
            return
        self._command = None
        self._commands.clear()
        if self.knobs.overload_clears != "power_on":
            self._latched &= ~OVERLOAD
        self._latched &= ~CURRENT
        self._overload_s = self._overcurrent_s = 0.0

    def _energise(self) -> None:
        self.set("torque", ON)
        position = self._measured()
        self._target = float(position)
        self.profile.reset(position)
        self._command = Command(self.now, None, 0, 0, 0)

    def _take_motion(self, names: set[str]) -> None:
        trigger = "goal_speed" if self.get("mode") == VELOCITY else "goal_position"
        is_goal = "goal_position" in names
        if trigger in names and self.knobs.goal_write_energises and self.get("torque") != ON:
            self._energise()
        if is_goal and self.knobs.overload_clears == "new_goal":
            self._latched &= ~OVERLOAD
            self._overload_s = 0.0
        if self.get("torque") == ON:
            self._queue(self.get("goal_position") if is_goal else None)

    def _queue(self, goal: int | None) -> None:
        self._commands.append(
            Command(
                self.now + self.knobs.dead_time_s,
                goal,
                self.get("goal_speed"),
                self.get("acceleration"),
                self.get("goal_pwm"),
            )
        )

    # Motion

    def drive(self, dt: float) -> None:
        values = self.registers.values
        self._protect(dt)
        while self._commands and self._commands[0].due <= self.now:
            self._begin(self._commands.popleft())
        if not self.output_on or self._command is None:
            self.profile.reset(self._measured())
            self.motor.coast(dt, damping=10 if values["torque"] == DAMPED else 1)
            return
        limit = values["torque_limit"] / 1000
        if self._latched & OVERLOAD & values["unload_conditions"]:
            limit = min(limit, values["protective_torque"] / 100)
        output = self._wanted_output(self._command, dt)
        self.motor.step(max(-limit, min(limit, output)), self.supply_v, dt)

    def _begin(self, command: Command) -> None:
        self._command = command
        if command.goal is None:
            return
        if self.get("mode") == STEP:
            self._target += command.goal
            return
        lowest, highest = self.get("min_angle"), self.get("max_angle")
        goal = command.goal
        self._target = max(lowest, min(highest, goal)) if highest or lowest else goal

    def _measured(self) -> float:
        """Return the position that the loop controls: not bounded to a turn except in mode 0."""
        return self.reported() if self.get("mode") == POSITION else round(self.encoder)

    def _wanted_output(self, command: Command, dt: float) -> float:
        values, measured = self.registers.values, self._measured()
        mode = values["mode"]
        if mode == PWM:
            return command.pwm / 1000
        unit = 1 if values["phase"] & SPEED_IN_STEPS else 50
        acceleration = (command.acceleration or values["max_acceleration"]) * 100
        fastest = values["max_speed"] * 50
        speed = command.speed * unit
        if mode == VELOCITY:
            self.profile.follow_velocity(max(-fastest, min(fastest, speed)), acceleration, dt)
            # A blocked motor does not store up travel.
            self.profile.position = max(measured - 300, min(measured + 300, self.profile.position))
        else:
            if not speed and values["phase"] & ZERO_SPEED_IS_FASTEST:
                speed = fastest
            self.profile.step(self._target, min(abs(speed), fastest), acceleration, dt)
        error = self.profile.position - measured
        if -values["dead_zone_cw"] <= error <= values["dead_zone_ccw"] and mode != VELOCITY:
            return 0.0
        return self.motor.proportional(error, values["position_p"] / 32)

    # Protection and feedback

    def _protect(self, dt: float) -> None:
        values, output = self.registers.values, abs(self.motor.output)
        if self.knobs.heats:
            self.temperature_c += (0.35 * output**2 - (self.temperature_c - 30) / 120) * dt
        self._overload_s = self._overload_s + dt if output * 100 > values["overload_torque"] else 0
        if self._overload_s > values["protection_time"] * 0.01:
            self._latched |= OVERLOAD
        too_much = self._current() >= values["protection_current"]
        self._overcurrent_s = self._overcurrent_s + dt if too_much else 0.0
        if self._overcurrent_s > values["overcurrent_time"] * 0.01:
            self._latched |= CURRENT
        status = self._latched
        if not values["min_voltage"] <= round(self.supply_v * 10) <= values["max_voltage"]:
            status |= VOLTAGE
        if self.knobs.encoder_fault:
            status |= ENCODER
        if self.temperature_c > values["max_temperature"]:
            status |= TEMPERATURE
        if status != values["status"]:
            self.set("status", status)

    def _current(self) -> int:
        return round(abs(self.motor.output) * self.motor.data.stall_a / 0.0065)

    def _refresh(self) -> None:
        output, velocity = self.motor.output, self.motor.velocity
        unit = 1 if self.get("phase") & SPEED_IN_STEPS else 50
        position = 0 if self.now < self._zero_until else self.reported()
        shown_values = {
            "position": position,
            "speed": round(velocity / unit),
            "load": round(output * 1000),
            "voltage": round(self.supply_v * 10),
            "temperature": round(self.temperature_c),
            "staged": int(self._staged is not None),
            "moving": int(abs(velocity) > 10 or bool(self._commands)),
            "target": round(self._target),
            "current": round(math.copysign(self._current(), output)),
        }
        for name, value in shown_values.items():
            self.set(name, value)
