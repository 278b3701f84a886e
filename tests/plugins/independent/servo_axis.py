"""Axis of the CiA 402 drive: follows set-points with a lag and a highest speed; modes of operation.

Positions are counts of an absolute encoder; objects have the units of the factor group.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.plugins.independent.cia402_node import ServoDrive

COAST_S = 0.03  # time constant of an axis without torque
FRICTION_HZ = 2.0
GRAVITY, MOTOR_INERTIA = 9.81, 0.05  # m/s², kg·m² of the joint
TORQUE = 10.0  # per mille of the rated torque for one turn/s²
PP, PV, HOMING, CSP, CSV, CST = 1, 3, 6, 8, 9, 10
MODES = {0, PP, PV, HOMING, CSP, CSV, CST}
# 17 and 18 search the limit switch, 33 and 34 the index pulse; 35 and 37 do not move.
HOMING_METHODS = {0, 17, 18, 33, 34, 35, 37}
FOLLOWING_ERROR = 0x8611


class Axis:
    """Motion of one axis in each mode of operation."""

    def __init__(self, drive: ServoDrive) -> None:
        self.drive = drive
        self.position = float(drive.knobs.power_on_position)
        self.counts_at_zero = 0.0  # homing moves it
        self.velocity = self.demand = self.torque = 0.0
        self.braking: float | None = None  # deceleration of a stop
        self.max_velocity = self.max_step = 0.0  # the fastest motion and csp step of the target
        self._rate = self._interpolated_s = 0.0  # of csp: speed of the demand, time left
        self._speed = 0.0  # of the demand in a profile mode
        self._beyond_s = self._within_s = 0.0  # time with following error, within the target window
        self._setpoint: float | None = None
        self._next_setpoint: float | None = None
        self._end: float | None = None  # set-point whose profile has ended
        self._acknowledged = self._reached = False
        self._homing = "idle"
        self._on_switch = False  # of a homing: the limit switch was reached
        self._homing_s = 0.0  # since its start
        self._braked_s = 0.0  # time until the brake is released
        self._unheld_s = 0.0  # time without torque until the brake holds

    @property
    def scale(self) -> float:
        """Position units per count: feed constant / (encoder resolution × gear ratio)."""
        defaults = (0x608F, self.drive.knobs.encoder), (0x6091, 1), (0x6092, self.drive.knobs.feed)
        resolution, gear, feed = (
            self.drive.get(index, 1, default) / self.drive.get(index, 2, 1)
            for index, default in defaults
        )
        return feed / (resolution * gear)

    def counts_of(self, position: int) -> float:
        return position / self.scale + self.counts_at_zero

    def deceleration(self, option: int) -> float:
        """Return the deceleration of an option code: 1 slow down ramp, others quick stop ramp."""
        slow = self.drive.get(0x6084, 0, self.drive[0x6083])
        return max(slow if option == 1 else self.drive.get(0x6085, 0, slow), 1) / self.scale

    @property
    def is_braked(self) -> bool:
        """The brake holds the axis, and set-points are ignored."""
        return self._braked_s > 0.0

    # Commands

    def enable(self) -> None:
        """Begin to release the brake."""
        self._braked_s = self.drive.knobs.brake_release_s

    def drop(self) -> None:
        """Have no torque from now on, while the brake has yet to close."""
        self._unheld_s = self.drive.knobs.brake_close_s

    def begin_mode(self) -> None:
        """Start the mode of operation, at enable or when it is changed."""
        self._demand_velocity()
        self._beyond_s = self._within_s = 0.0
        self._setpoint = self._next_setpoint = self._end = None
        self._acknowledged = self._reached = False
        self._homing = "idle"
        if self.drive[0x6061] == CSP:  # the standard lets the drive follow what 0x607A contains
            self._interpolate(self.drive[0x607A], self.position)

    def set_target(self, target: int) -> None:
        if self.drive[0x6061] == CSP:
            self._interpolate(target, self.counts_of(self.drive[0x607A]))

    def _interpolate(self, target: int, previous: float) -> None:
        end = self._nearest(self.counts_of(target))
        self.max_step = max(self.max_step, abs(end - self._nearest(previous)))
        period_s = self.drive.get(0x60C2, 1) * 10.0 ** self.drive.get(0x60C2, 2)
        self._interpolated_s = max(period_s, 1e-4)
        self._rate = (end - self.demand) / self._interpolated_s

    def _nearest(self, counts: float) -> float:
        """Return the place next to the demand that has the same position object."""
        span = 2**self.drive.knobs.position_bits / self.scale
        return counts - span * round((counts - self.demand) / span)

    def start(self, controlword: int) -> None:
        """Obey a rising bit 4: new set-point, start of homing."""
        if self.drive[0x6061] == HOMING:
            self._homing, self._on_switch, self._homing_s = "running", False, 0.0
        elif self.drive[0x6061] == PP:
            self._take_setpoint(controlword)

    def _take_setpoint(self, controlword: int) -> None:
        target = self.counts_of(self.drive[0x607A])
        if controlword & 0x40:  # relative
            base = self.demand if self._setpoint is None else self._setpoint
            target += base - self.counts_at_zero
        if self._setpoint is None or controlword & 0x20:  # change immediately
            self._setpoint, self._next_setpoint = target, None
        elif self._next_setpoint is None:
            self._next_setpoint = target
        else:
            return
        self._acknowledged, self._reached = True, False

    # Motion

    def move(self, step_s: float, energised: bool, halted: bool) -> None:
        before = self.velocity
        if not energised:
            if self._unheld_s > 0.0:
                self._unheld_s -= step_s
                self.velocity -= self.drive.knobs.fall * step_s
            elif self.drive.knobs.brake_close_s:
                self.velocity = 0.0
            else:
                self.velocity *= math.exp(-step_s / COAST_S)
            self._demand_velocity(step_s)
        elif self.is_braked:
            self._braked_s -= step_s
            self.velocity, self.demand = 0.0, self.position
            if not self.is_braked:
                self.begin_mode()
        elif self.braking is not None or halted:
            stop = self.deceleration(self.drive.get(0x605D, 0, 1))
            deceleration = stop if self.braking is None else self.braking
            self.velocity = ramped(self.velocity, 0.0, deceleration, deceleration, step_s)
            self._demand_velocity(step_s)
        else:
            self._follow(step_s)
        limit = self.drive.knobs.max_speed
        self.velocity = min(max(self.velocity, -limit), limit)
        self.position += self.velocity * step_s
        self.max_velocity = max(self.max_velocity, abs(self.velocity))
        if self.drive[0x6061] != CST or not energised:
            acceleration = (self.velocity - before) / step_s + FRICTION_HZ * self.velocity
            torque = self._torque_for(acceleration)
            self.torque = min(max(torque, -3000.0), 3000.0) if energised else 0.0

    def _acceleration_by(self, torque: float) -> float:
        """Return counts/s² without friction by per mille of the rated torque.

        A link has its mass at the end: weight m·g·l·cos q, inertia m·l² and that of the motor.
        """
        knobs = self.drive.knobs
        if not knobs.link_mass_kg:
            return torque / TORQUE * knobs.encoder
        net = torque / 1e3 * knobs.rated_torque_nm + knobs.external_torque_nm - self._weight
        return net / self._inertia * knobs.link_counts_per_rad

    def _torque_for(self, acceleration: float) -> float:
        """Return the reverse of ``_acceleration_by``."""
        knobs = self.drive.knobs
        if not knobs.link_mass_kg:
            return TORQUE * acceleration / knobs.encoder
        net = acceleration / knobs.link_counts_per_rad * self._inertia
        return (net - knobs.external_torque_nm + self._weight) / knobs.rated_torque_nm * 1e3

    @property
    def _weight(self) -> float:
        """Torque of the link's weight, N·m."""
        knobs = self.drive.knobs
        angle = self.position / knobs.link_counts_per_rad
        return knobs.link_mass_kg * GRAVITY * knobs.link_length_m * math.cos(angle)

    @property
    def _inertia(self) -> float:
        """Inertia of link and motor, kg·m²."""
        return self.drive.knobs.link_mass_kg * self.drive.knobs.link_length_m**2 + MOTOR_INERTIA

    def _demand_velocity(self, step_s: float = 0.0) -> None:
        """Set the demand to what the axis does, so that a mode continues without a step."""
        self._speed, self._rate = self.velocity, 0.0
        self.demand = self.position + self.velocity * (self.drive.knobs.lag_s + step_s)

    def _follow(self, step_s: float) -> None:
        mode = self.drive[0x6061]
        if mode == CSV:
            share = 1 - math.exp(-step_s / self.drive.knobs.lag_s)
            self.velocity += (self.drive[0x60FF] / self.scale - self.velocity) * share
            return
        if mode == CST:
            limit = self.drive[0x6072]
            self.torque = float(min(max(self.drive[0x6071], -limit), limit))
            acceleration = self._acceleration_by(self.torque)
            self.velocity += (acceleration - FRICTION_HZ * self.velocity) * step_s
            return
        if mode == CSP:
            self._speed = self._rate if self._interpolated_s > 0 else 0.0
            self.demand += self._rate * min(step_s, self._interpolated_s)
            self._interpolated_s = max(self._interpolated_s - step_s, 0.0)
        else:
            if mode == PP:
                self._approach(step_s)
            elif mode == HOMING and self._homing == "running":
                self._search_home(step_s)
            elif mode == HOMING and self._homing == "error" and self.drive.knobs.homing_error_moves:
                pass
            else:
                self._profile(self.drive[0x60FF] / self.scale if mode == PV else 0.0, step_s)
            self.demand += self._speed * step_s
        self.velocity = (self.demand - self.position) / (self.drive.knobs.lag_s + step_s)
        self._watch_following_error(step_s)

    def _profile(self, target: float, step_s: float) -> None:
        up = max(self.drive[0x6083], 1) / self.scale
        self._speed = ramped(self._speed, target, up, self.deceleration(1), step_s)

    def _watch_following_error(self, step_s: float) -> None:
        window = self.drive[0x6065]
        error = abs(self.demand - self.position) * self.scale
        self._beyond_s = self._beyond_s + step_s if error > window != 0xFFFF_FFFF else 0.0
        if self._beyond_s and self._beyond_s * 1e3 >= self.drive[0x6066]:
            self.drive.fault(FOLLOWING_ERROR)

    def _approach(self, step_s: float) -> None:
        if not self.drive[0x6040] & 0x10 and self._next_setpoint is None:
            self._acknowledged = False
        if self._setpoint is None:
            self._profile(0.0, step_s)
        else:
            left, deceleration = self._setpoint - self.demand, self.deceleration(1)
            speed = min(self.drive[0x6081] / self.scale, math.sqrt(2 * deceleration * abs(left)))
            self._profile(math.copysign(speed, left), step_s)
            if abs(left) <= abs(self._speed) * step_s + 0.5:
                self.demand, self._speed = self._setpoint, 0.0
                self._end, self._setpoint = self._setpoint, self._next_setpoint
                self._next_setpoint = None
        self._watch_target(step_s)

    def _watch_target(self, step_s: float) -> None:
        """Set "target reached" when the position was in the window for the window time."""
        away = math.inf if self._end is None or self._setpoint is not None else self._end
        within = abs(away - self.position) * self.scale <= self.drive[0x6067]
        self._within_s = self._within_s + step_s if within else 0.0
        self._reached = self._within_s * 1e3 > self.drive[0x6068]

    def _search_home(self, step_s: float) -> None:
        method, turn = self.drive[0x6098], self.drive.knobs.encoder
        self._homing_s += step_s
        if self._homing_s > self.drive.knobs.homing_error_s:
            self._homing = "error"
        elif not self.drive[0x6040] & 0x10:
            self._homing = "idle"
        elif method in {35, 37}:
            self._set_home(self.position)
        elif method in {17, 18}:
            self._search_limit(-1 if method == 17 else 1, step_s)
        elif method in {33, 34}:
            before = math.floor(self.position / turn)
            after = math.floor((self.position + self.velocity * step_s) / turn)
            if before != after:
                self._set_home(max(before, after) * float(turn))
            speed = self.drive[0x6099, 2] / self.scale * (-1 if method == 33 else 1)
            acceleration = self.drive[0x609A] / self.scale
            self._speed = ramped(self._speed, speed, acceleration, acceleration, step_s)
        else:
            self._homing = "error"

    def _search_limit(self, direction: int, step_s: float) -> None:
        """Go to the limit switch, and back to its edge with the lower speed."""
        knobs = self.drive.knobs
        closed = not knobs.negative_limit < self.position < knobs.positive_limit
        edge = knobs.negative_limit if direction < 0 else knobs.positive_limit
        self._on_switch = self._on_switch or closed
        if self._on_switch and not closed:
            self._set_home(edge)
            return
        sub, towards = (2, -direction) if self._on_switch else (1, direction)
        speed = towards * self.drive[0x6099, sub] / self.scale
        acceleration = self.drive[0x609A] / self.scale
        self._speed = ramped(self._speed, speed, acceleration, acceleration, step_s)

    def _set_home(self, counts: float) -> None:
        self.counts_at_zero = counts - self.drive[0x607C] / self.scale
        self._homing = "attained"

    # Feedback

    def publish(self) -> None:
        """Write the actual values into their objects."""
        scale, bits = self.scale, self.drive.knobs.position_bits
        self.drive[0x6064] = wrapped((self.position - self.counts_at_zero) * scale, bits)
        self.drive[0x6062] = wrapped((self.demand - self.counts_at_zero) * scale, bits)
        self.drive[0x60F4] = wrapped((self.demand - self.position) * scale)
        self.drive[0x606C] = wrapped(self.velocity * scale)
        self.drive[0x6077] = self.torque

    def status_bits(self, halted: bool) -> int:
        """Return bits 10, 12 and 13 of the statusword in the present mode."""
        mode, still = self.drive[0x6061], not round(self.velocity)
        reached = bit12 = bit13 = False
        if mode == PP:
            reached, bit12 = self._reached, self._acknowledged
        elif mode == PV:
            reached = abs(self.drive[0x60FF] - self.drive[0x606C]) <= 100
            bit12 = still
        elif mode == HOMING:
            reached = still and self._homing != "running"
            bit12, bit13 = self._homing == "attained", self._homing == "error"
        elif mode in {CSP, CSV, CST}:
            follows = self.drive.knobs.following_bit and not (halted or self.is_braked)
            bit12, bit13 = follows, self._beyond_s > 0
        return 0x400 * (still if halted else reached) | 0x1000 * bit12 | 0x2000 * bit13


def ramped(speed: float, target: float, up: float, down: float, step_s: float) -> float:
    """Return the speed one step closer to a target."""
    faster = abs(target) > abs(speed) and target * speed >= 0
    change = (up if faster else down) * step_s
    return speed + min(max(target - speed, -change), change)


def wrapped(value: float, bits: int = 32) -> int:
    """Return a value as an object of so many bits holds it."""
    half = 1 << (bits - 1)
    return (round(value) + half) % (2 * half) - half
