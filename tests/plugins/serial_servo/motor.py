"""Motor, gear and position loop of a simulated servo.

A massless first-order model: the loop turns the following error into a duty cycle, the duty cycle
into torque, and torque minus load into speed. Constants are those of an STS3215 at 12 V.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tests.plugins.serial_servo.joints import STEP_RAD, Joint


@dataclass(slots=True)
class MotorData:
    """Constants of a motor with its gear, at the output shaft."""

    stall_nm: float = 2.9
    no_load_rad_s: float = 4.0
    stiffness_nm_rad: float = 15.0
    lag_s: float = 0.03
    stall_a: float = 2.7
    nominal_v: float = 12.0
    play_rad: float = 0.0
    """Backlash: the shaft moves freely by this angle in all. The encoder is at the shaft."""

    free_nm_s_rad: float = 0.9
    """Friction of a shaft without torque: it falls with load / this, rad/s."""


class Profile:
    """Set-point generator: limited speed and acceleration, in steps."""

    def __init__(self) -> None:
        self.position = 0.0
        self.velocity = 0.0

    def reset(self, position: float) -> None:
        self.position, self.velocity = position, 0.0

    def step(self, goal: float, speed: float, acceleration: float, dt: float) -> None:
        """Advance towards ``goal`` (steps) by ``dt`` seconds; infinite limits are allowed."""
        error = goal - self.position
        stopping = math.sqrt(2 * acceleration * abs(error)) if error else 0.0
        desired = math.copysign(min(speed, stopping), error)
        if abs(error) <= abs(desired) * dt and abs(self.velocity) <= abs(desired) + (
            acceleration * dt
        ):
            self.reset(goal)
            return
        self.follow_velocity(desired, acceleration, dt)

    def follow_velocity(self, desired: float, acceleration: float, dt: float) -> None:
        """Advance with ``desired`` steps/s, reached by ``acceleration`` steps/s²."""
        change = acceleration * dt
        self.velocity += max(-change, min(change, desired - self.velocity))
        self.position += self.velocity * dt


class Motor:
    """Motor and gear between a servo's output stage and a joint."""

    def __init__(self, joint: Joint, data: MotorData) -> None:
        self.joint = joint
        self.data = data
        self.output = 0.0
        """Duty cycle, -1 … 1."""
        self.velocity = 0.0
        """Speed of the shaft, steps/s."""
        self._rotor = joint.angle

    def proportional(self, error_steps: float, gain: float) -> float:
        """Return the duty cycle for a following error; ``gain`` 1 is the factory setting."""
        return error_steps * STEP_RAD * self.data.stiffness_nm_rad * gain / self.data.stall_nm

    def step(self, output: float, supply_v: float, dt: float) -> None:
        """Apply a duty cycle for ``dt`` seconds."""
        data = self.data
        self.output = output
        friction = data.stiffness_nm_rad * data.lag_s
        speed = (output * data.stall_nm * supply_v / data.nominal_v + self.joint.load_nm) / friction
        limit = data.no_load_rad_s * supply_v / data.nominal_v
        self._move(max(-limit, min(limit, speed)), dt)

    def coast(self, dt: float, *, damping: float = 1.0) -> None:
        """Leave the shaft to its load for ``dt`` seconds; ``damping`` multiplies the friction."""
        self.output = 0.0
        self._move(self.joint.load_nm / (self.data.free_nm_s_rad * damping), dt)

    def _move(self, speed: float, dt: float) -> None:
        joint, half_play = self.joint, self.data.play_rad / 2
        before = joint.angle
        rotor = max(before - half_play, min(before + half_play, self._rotor)) + speed * dt
        shaft = joint.bounded(max(rotor - half_play, min(rotor + half_play, before)))
        self._rotor = max(shaft - half_play, min(shaft + half_play, rotor))
        joint.angle = shaft
        self.velocity = (shaft - before) / dt / STEP_RAD
