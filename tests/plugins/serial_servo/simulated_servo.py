"""Base of simulated servos: power, time in fixed steps, and the record of what was executed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from tests.plugins.serial_servo.faults import Faults
from tests.plugins.serial_servo.joints import STEP_RAD, Joint
from tests.plugins.serial_servo.motor import Motor, MotorData, Profile
from tests.plugins.serial_servo.registers import Register, Registers

STEP_S = 0.004
ENCODER_MIDDLE = 2048
"""Encoder reading at a joint angle of 0 rad."""

RECORDED_STEPS = 60_000
"""Steps kept in ``executed``: four minutes."""


class Write(NamedTuple):
    """One register that a client wrote, with the state right after it."""

    time_s: float
    address: int
    name: str
    value: int
    torque: bool
    goal: int
    position: int


class Executed(NamedTuple):
    """One internal step of a servo.

    torque: the output stage is on. goal: the goal register. target: set-point of the position loop,
    steps; None without torque. position: as reported, steps. angle: of the joint, rad. velocity:
    steps/s. output: duty cycle, -1 … 1.
    """

    time_s: float
    torque: bool
    goal: int
    target: float | None
    position: int
    angle: float
    velocity: float
    output: float


class SimulatedServo(ABC):
    """One servo without a bus: registers, motor and a joint.

    Times are those of ``time.monotonic`` on a bus; without one, ``start`` and ``advance`` take any
    clock. Not thread-safe: on a bus, hold ``bus.lock`` to read more than one field.
    """

    def __init__(
        self, table: Iterable[Register], size: int, data: MotorData, joint: Joint | None
    ) -> None:
        self.registers = Registers(table, size)
        self.joint = joint or Joint()
        self.motor = Motor(self.joint, data)
        self.profile = Profile()
        self.faults = Faults()
        self.writes: list[Write] = []
        self.executed: deque[Executed] = deque(maxlen=RECORDED_STEPS)
        self.powered = True
        self.supply_v = data.nominal_v
        self.temperature_c = 30.0
        self.now = 0.0
        self._booted_at = 0.0

    # What a protocol adds

    @property
    @abstractmethod
    def output_on(self) -> bool:
        """Whether the output stage drives the motor."""

    @property
    @abstractmethod
    def boot_s(self) -> float:
        """Time from power-on to the first reply, seconds."""

    @abstractmethod
    def reset(self) -> None:
        """Set registers and state as after power-on."""

    @abstractmethod
    def reported(self) -> int:
        """Return the present position as a client reads it, steps."""

    @abstractmethod
    def drive(self, dt: float) -> None:
        """Advance protection, set-point and motor by one step."""

    # Registers

    @property
    def id(self) -> int:
        return self.registers.values["id"]

    def get(self, name: str) -> int:
        """Return a register, signed values with their sign."""
        return self.registers.values[name]

    def set(self, name: str, value: int) -> None:
        """Set a register from inside, read-only ones too; persistent ones are saved."""
        self.registers.set(name, value)

    # Power and time

    @property
    def answering(self) -> bool:
        return self.powered and self.now >= self._booted_at

    def start(self, now: float) -> None:
        """Set the clock; the servo has had power for long."""
        self.now = self._booted_at = now

    def power_off(self) -> None:
        """Take the supply away: no torque, no replies; RAM and turns are lost."""
        self.powered = False

    def power_on(self) -> None:
        """Give the supply back: ``boot_s`` later the servo answers, with defaults in RAM."""
        self.powered = True
        self.reboot()

    def reboot(self) -> None:
        self._booted_at = self.now + self.boot_s
        self.reset()

    @property
    def encoder(self) -> float:
        """Shaft angle in steps, not bounded to one turn."""
        return self.joint.angle / STEP_RAD + ENCODER_MIDDLE

    def advance(self, now: float) -> None:
        """Execute all steps up to ``now``."""
        values = self.registers.values
        while self.now + STEP_S <= now:
            self.now += STEP_S
            if on := self.answering:
                self.drive(STEP_S)
                on = self.output_on
            else:
                self.motor.coast(STEP_S)
            self.executed.append(
                Executed(
                    self.now,
                    on,
                    values["goal_position"],
                    self.profile.position if on else None,
                    self.reported(),
                    self.joint.angle,
                    self.motor.velocity,
                    self.motor.output,
                )
            )

    def record_writes(self, written: Iterable[Register]) -> None:
        for register in written:
            self.writes.append(
                Write(
                    self.now,
                    register.address,
                    register.name,
                    self.get(register.name),
                    self.output_on,
                    self.get("goal_position"),
                    self.reported(),
                )
            )
