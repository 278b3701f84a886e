"""Simulated Dynamixel X servo, protocol 2.0: control table and behaviour, without a bus.

Written from the maker's e-manual. Names of registers are those of ``dxl_table``.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import NamedTuple

from tests.plugins.serial_servo.dxl_table import MODELS, control_table
from tests.plugins.serial_servo.joints import Joint
from tests.plugins.serial_servo.registers import Register
from tests.plugins.serial_servo.simulated_servo import SimulatedServo

TURN = 4096
BAUDS = (9600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)

RESULT_FAIL, INSTRUCTION, CRC, RANGE, LENGTH, LIMIT, ACCESS = range(1, 8)
"""Error numbers of status packets; 0x80 is added while there is a hardware error."""

VOLTAGE, HEAT, ENCODER, SHOCK, OVERLOAD = 0x01, 0x04, 0x08, 0x10, 0x20
"""Bits of register 70, hardware error, and of 63, shutdown."""

REVERSE, TIME_BASED, TORQUE_BY_GOAL = 0x01, 0x04, 0x08
"""Bits of register 10, drive mode."""

CURRENT_MODE, VELOCITY_MODE, POSITION_MODE, EXTENDED, CURRENT_POSITION, PWM_MODE = 0, 1, 3, 4, 5, 16

VELOCITY_UNIT = 0.229 * TURN / 60
"""Steps/s per unit of velocity."""

ACCELERATION_UNIT = 214.577 * TURN / 3600
"""Steps/s² per unit of acceleration."""

MAX_PWM = 885
EEPROM_END = 64
LAST_POSITION = 1_048_575
GOALS = {"goal_pwm", "goal_current", "goal_velocity", "goal_position"}


@dataclass(slots=True)
class DxlKnobs:
    """Traits of one servo; each may change at any time."""

    dead_time_s: float = 0.005
    goal_at_power_on: int | None = None
    """Goal position after power-on, steps; None: the present position."""
    torque_on_target: str = "goal"
    """Torque on: "goal" drives to the goal register, "present" sets the goal to the position."""
    overload_output: float = 0.8
    """Duty cycle that is an overload after ``overload_s``."""
    overload_s: float = 1.0
    encoder_fault: bool = False
    electrical_shock: bool = False
    heats: bool = True
    boot_s: float = 0.3


class Command(NamedTuple):
    """A goal position with its profile, in steps and seconds."""

    due: float
    goal: int
    speed: float
    acceleration: float


def span(register: Register) -> tuple[int, int]:
    """Return the first address of a register and the one after it."""
    return register.address, register.address + register.size


class Servo(SimulatedServo):
    """One Dynamixel X servo.

    model: a key of ``MODELS``. angle: of the joint at the start, rad; 0 is encoder step 2048.
    registers: values of EEPROM registers, by name; "baud" is 3 (1 Mbit/s) unless given, where a new
    servo has 1. id: None: that of its key on the bus.
    """

    def __init__(
        self,
        model: str = "xl430-w250",
        *,
        id: int | None = None,  # noqa: A002 - the maker's word
        angle: float = 0.0,
        joint: Joint | None = None,
        knobs: DxlKnobs | None = None,
        registers: dict[str, int] | None = None,
    ) -> None:
        self.model = MODELS[model]
        super().__init__(
            control_table(self.model), 1024, replace(self.model.motor), joint or Joint(angle)
        )
        self.given_id = id
        self.knobs = knobs or DxlKnobs()
        for name, value in {"baud": 3, **(registers or {})}.items():
            self.set(name, value)
        if id is not None:
            self.set("id", id)
        self._indirect = {
            data + index: f"indirect_address_{index + 1 + skipped}"
            for (_, data, count), skipped in zip(
                self.model.indirect, (0, self.model.indirect[0][2]), strict=False
            )
            for index in range(count)
        }
        self._default_p = self.get("position_p")
        self._instruction_at = 0.0
        self._staged: tuple[int, bytes] | None = None
        self._commands: deque[Command] = deque()
        self._command: Command | None = None
        self._origin = 0
        self._overload_s = 0.0
        self._error = 0
        self.reset()

    # State

    @property
    def boot_s(self) -> float:
        return self.knobs.boot_s

    @property
    def output_on(self) -> bool:
        return bool(self.registers.values["torque"])

    def reset(self) -> None:
        self.registers.load()
        self._staged = None
        self._error, self._overload_s = 0, 0.0
        self._within_a_turn()
        self._reset_goals()
        goal = self.knobs.goal_at_power_on
        self.set("goal_position", self.reported() if goal is None else goal)
        if self.get("startup") & 1:
            self.set("torque", 1)
            self._switch()

    def _reset_goals(self) -> None:
        self._command = None
        self._commands.clear()
        for name, value in {
            "profile_velocity": 0,
            "profile_acceleration": 0,
            "goal_velocity": 0,
            "goal_pwm": self.get("pwm_limit"),
            "goal_position": self.reported(),
        }.items():
            self.set(name, value)
        if self.model.current_ma is not None:
            self.set("goal_current", self.get("current_limit"))

    @property
    def _turned(self) -> int:
        """Shaft position in the direction of the drive mode, steps."""
        reverse = self.registers.values["drive_mode"] & REVERSE
        return TURN - round(self.encoder) if reverse else round(self.encoder)

    def _within_a_turn(self) -> None:
        self._origin = math.floor(self._turned / TURN) * TURN

    def reported(self) -> int:
        """Return the position: true + homing offset, counted over turns since they were lost."""
        values = self.registers.values
        offset = values["homing_offset"]
        if values["mode"] == POSITION_MODE and abs(offset) > TURN // 4:
            offset = 0
        return self._turned - self._origin + offset

    def return_delay_s(self) -> float:
        return self.get("return_delay") * 2e-6

    @property
    def alert(self) -> int:
        """0x80 while there is a hardware error, to be added to the error of a reply."""
        return 0x80 if self._error else 0

    def trip(self, bits: int) -> None:
        """Latch hardware errors, as what they are about would; a reboot clears them."""
        self._error |= bits

    # Requests

    def notice_instruction(self) -> None:
        """Restart the bus watchdog: an instruction was on the bus, for any servo."""
        self._instruction_at = self.now

    def _resolved(self, address: int) -> int:
        name = self._indirect.get(address)
        return address if name is None else self.registers.values[name]

    def read(self, address: int, count: int) -> bytes:
        self._refresh()
        memory = self.registers.memory
        places = (self._resolved(place) for place in range(address, address + count))
        return bytes(memory[place] if place < len(memory) else 0 for place in places)

    def write(self, address: int, data: bytes) -> int:
        """Write a block, all of it or nothing; return the error number."""
        placed = {self._resolved(address + index): byte for index, byte in enumerate(data)}
        found = (self.registers.at(place) for place in placed)
        written = list(dict.fromkeys(register for register in found if register is not None))
        blocks = [
            (register, bytes(placed[place] for place in range(*span(register)) if place in placed))
            for register in written
        ]
        errors = (self._rejection(register, block) for register, block in blocks)
        error = next(filter(None, errors), 0) if written else ACCESS
        if error:
            return error
        mode = self.get("mode")
        for register, block in blocks:
            self.registers.store(register, register.address, block, save=register.persistent)
        names = {register.name for register in written}
        if self.get("mode") != mode:
            if self.get("mode") == POSITION_MODE:
                self._within_a_turn()
            self._reset_goals()
        if "torque" in names:
            self._switch()
        if names & GOALS:
            self._take_goals(names)
        self.record_writes(written)
        return 0

    def _rejection(self, register: Register, data: bytes) -> int:
        """Return the error number of a write to one register, 0 if it is accepted."""
        if not register.writable or (register.address < EEPROM_END and self.get("torque")):
            return ACCESS
        if len(data) != register.size:
            return LENGTH
        value = register.decode(data)
        stopped = self.get("bus_watchdog") < 0
        if stopped and (register.name in GOALS or (register.name == "bus_watchdog" and value)):
            return RANGE
        lowest, highest = register.lowest, register.highest
        if lowest is not None and highest is not None and not lowest <= value <= highest:
            return RANGE
        if register.name == "mode" and value not in self._modes():
            return RANGE
        bounds = self._bounds(register.name)
        return 0 if bounds is None or bounds[0] <= value <= bounds[1] else LIMIT

    def _modes(self) -> set[int]:
        modes = {VELOCITY_MODE, POSITION_MODE, EXTENDED, PWM_MODE}
        return modes if self.model.current_ma is None else modes | {CURRENT_MODE, CURRENT_POSITION}

    def _bounds(self, name: str) -> tuple[int, int] | None:
        if name == "goal_position":
            if self.get("mode") == POSITION_MODE:
                return self.get("min_position"), self.get("max_position")
            return -LAST_POSITION, LAST_POSITION
        limits = {
            "goal_pwm": "pwm_limit",
            "goal_current": "current_limit",
            "goal_velocity": "velocity_limit",
        }
        if name not in limits:
            return None
        limit = self.get(limits[name])
        return -limit, limit

    def stage(self, address: int, data: bytes) -> int:
        self._staged = (address, data)
        return 0

    def act(self) -> int:
        staged, self._staged = self._staged, None
        return INSTRUCTION if staged is None else self.write(*staged)

    def clear_turns(self) -> int:
        if abs(self.motor.velocity) > VELOCITY_UNIT:
            return RESULT_FAIL
        self._within_a_turn()
        return 0

    def restore_factory_settings(self, kept: set[str]) -> None:
        values = {name: self.get(name) for name in kept}
        self.registers.restore_factory_settings()
        for name, value in values.items():
            self.set(name, value)
        self.reboot()

    def _switch(self) -> None:
        if self.get("torque") and self._error & self.get("shutdown"):
            self.set("torque", 0)
        if not self.get("torque"):
            self._command = None
            self._commands.clear()
            return
        if self._command is not None:
            return
        if self.get("mode") == POSITION_MODE:
            self._within_a_turn()
        self._instruction_at = self.now
        self._hold()
        if self.knobs.torque_on_target == "present":
            self.set("goal_position", self.reported())
        self._queue()

    def _hold(self) -> None:
        position = self.reported()
        self.profile.reset(position)
        self._command = Command(self.now, position, math.inf, math.inf)

    def _take_goals(self, names: set[str]) -> None:
        if not self.get("torque"):
            if not self.get("drive_mode") & TORQUE_BY_GOAL or self._error & self.get("shutdown"):
                return
            self.set("torque", 1)
            self._switch()
        if "goal_position" in names:
            self._queue()

    def _queue(self) -> None:
        goal = self.get("goal_position")
        velocity, acceleration = self.get("profile_velocity"), self.get("profile_acceleration")
        speed, ramp = math.inf, math.inf
        if velocity and self.get("drive_mode") & TIME_BASED:
            rise = min(acceleration, velocity / 2)
            speed = abs(goal - self.profile.position) / (velocity - rise) * 1000
            ramp = speed / rise * 1000 if rise else math.inf
        elif velocity:
            speed = velocity * VELOCITY_UNIT
            ramp = acceleration * ACCELERATION_UNIT or math.inf
        self._commands.append(Command(self.now + self.knobs.dead_time_s, goal, speed, ramp))

    # Motion

    def drive(self, dt: float) -> None:
        self._protect(dt)
        self._watch_bus()
        while self._commands and self._commands[0].due <= self.now:
            self._command = self._commands.popleft()
        if not self.output_on or self._command is None:
            self.profile.reset(self.reported())
            self.motor.coast(dt)
            return
        limit = self._output_limit()
        output = max(-limit, min(limit, self._wanted_output(self._command, dt)))
        reverse = self.registers.values["drive_mode"] & REVERSE
        self.motor.step(-output if reverse else output, self.supply_v, dt)

    def _watch_bus(self) -> None:
        limit = self.registers.values["bus_watchdog"]
        if limit > 0 and self.output_on and self.now - self._instruction_at > limit * 0.02:
            self.set("bus_watchdog", -1)
            self._commands.clear()
            self.set("goal_velocity", 0)
            for name in ("profile_velocity", "profile_acceleration"):
                self.set(name, 0)
            self._hold()

    def _output_limit(self) -> float:
        values = self.registers.values
        if values["mode"] == PWM_MODE:
            return values["pwm_limit"] / MAX_PWM
        limit = abs(values["goal_pwm"]) / MAX_PWM
        if self.model.current_ma is not None:
            allowed = values["current_limit"]
            if values["mode"] == CURRENT_POSITION:
                allowed = min(allowed, abs(values["goal_current"]))
            limit = min(limit, self._output_of(allowed))
        return limit

    def _output_of(self, current: float) -> float:
        """Return the duty cycle that draws ``current`` (register unit) at standstill."""
        return current * (self.model.current_ma or 1) / 1000 / self.motor.data.stall_a

    def _wanted_output(self, command: Command, dt: float) -> float:
        values = self.registers.values
        mode = values["mode"]
        if mode == PWM_MODE:
            return 0.0 if values["bus_watchdog"] < 0 else values["goal_pwm"] / MAX_PWM
        if mode == CURRENT_MODE:
            current = 0 if values["bus_watchdog"] < 0 else values["goal_current"]
            return self._output_of(current)
        measured = self.reported()
        if mode == VELOCITY_MODE:
            ramp = values["profile_acceleration"] * ACCELERATION_UNIT or math.inf
            self.profile.follow_velocity(values["goal_velocity"] * VELOCITY_UNIT, ramp, dt)
            # A blocked motor does not store up travel.
            self.profile.position = max(measured - 300, min(measured + 300, self.profile.position))
        else:
            self.profile.step(command.goal, command.speed, command.acceleration, dt)
        error = self.profile.position - measured
        return self.motor.proportional(error, values["position_p"] / self._default_p)

    # Protection and feedback

    def _protect(self, dt: float) -> None:
        values, output = self.registers.values, abs(self.motor.output)
        if self.knobs.heats:
            self.temperature_c += (0.35 * output**2 - (self.temperature_c - 30) / 120) * dt
        overloaded = output >= self.knobs.overload_output
        self._overload_s = self._overload_s + dt if overloaded else 0.0
        found = {
            VOLTAGE: not values["min_voltage"]
            <= round(self.supply_v * 10)
            <= values["max_voltage"],
            HEAT: self.temperature_c > values["temperature_limit"],
            ENCODER: self.knobs.encoder_fault,
            SHOCK: self.knobs.electrical_shock,
            OVERLOAD: self._overload_s > self.knobs.overload_s,
        }
        self._error |= sum(bit for bit, happens in found.items() if happens)
        if self._error & values["shutdown"] and values["torque"]:
            self.set("torque", 0)
            self._switch()

    def _refresh(self) -> None:
        values = self.registers.values
        sign = -1 if values["drive_mode"] & REVERSE else 1
        output, velocity = sign * self.motor.output, sign * self.motor.velocity
        load = output * 1000
        if self.model.current_ma is not None:
            load = output * self.motor.data.stall_a * 1000 / self.model.current_ma
        target = self.profile.position
        position = self.reported()
        ongoing = values["torque"] and target != values["goal_position"]
        arrived = abs(values["goal_position"] - position) <= 20
        shown = {
            "registered": int(self._staged is not None),
            "hardware_error": self._error,
            "tick": int(self.now * 1000) % 32_768,
            "moving": int(abs(velocity) > values["moving_threshold"] * VELOCITY_UNIT),
            "moving_status": (2 if ongoing else 0) | int(arrived),
            "pwm": round(output * MAX_PWM),
            "load": round(load),
            "velocity": round(velocity / VELOCITY_UNIT),
            "position": position,
            "velocity_trajectory": round(self.profile.velocity / VELOCITY_UNIT),
            "position_trajectory": round(target),
            "voltage": round(self.supply_v * 10),
            "temperature": round(self.temperature_c),
        }
        for name, value in shown.items():
            self.set(name, value)
