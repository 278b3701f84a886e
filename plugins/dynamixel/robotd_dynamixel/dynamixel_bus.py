"""Dynamixel X servos on a serial port."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence

from robotd.api import Clock
from robotd_dynamixel import frames, registers
from robotd_serial_servo.request_bus import Parsed, Reply, RequestBus
from robotd_serial_servo.serial_port import SerialPort
from robotd_serial_servo.servo_bus import (
    TICKS_PER_TURN,
    Goal,
    ServoIdentity,
    ServoState,
)

STOPS_AFTER_S = 0.2  # without a request: the bus watchdog of the servos
REBOOT_TRIES = 3
# From TORQUE on: torque, hardware error, watchdog, goal PWM, goal, PWM, current, velocity,
# position, voltage, temperature.
_STATE = struct.Struct("<B5xB27xbxh14xi4xhhii8xHB")
_SEED = struct.Struct("<IIi")  # from PROFILE on: acceleration, velocity, goal
_LIMITS = struct.Struct("<ii")  # from MAX_POSITION on
_GOAL_BYTES = 4


class DynamixelBus(RequestBus):
    """Dynamixel X servos with protocol 2.0. One thread at a time."""

    overhead = frames.OVERHEAD
    ping_bytes = 3
    offset_sign = -1  # reported = true + offset

    def __init__(self, port: SerialPort, clock: Clock, reply_timeout_s: float) -> None:
        super().__init__(port, clock, reply_timeout_s)
        # Of the servos that were identified.
        self._pwm_limits: dict[int, int] = {}
        self._timed: set[int] = set()
        self._amperes: dict[int, float] = {}
        self._armed: set[int] = set()  # their watchdogs were set

    def _parse(self, line: bytes, size: int) -> Parsed:
        return frames.parse(line, size)

    def _ping_frame(self, servo: int) -> bytes:
        return frames.frame(servo, frames.PING)

    def _read_frame(self, servo: int, address: int, size: int) -> bytes:
        return frames.read(servo, address, size)

    def _write_frame(self, servo: int, address: int, data: bytes) -> bytes:
        return frames.write(servo, address, data)

    def _rejection(self, reply: Reply) -> str:
        number = reply.error & ~frames.ALERT
        return frames.ERRORS.get(number, f"error {number}") if number else ""

    def identify(self, servo: int) -> ServoIdentity:
        values = self._read(servo, 0, registers.SETTINGS_BYTES)

        def number(address: int, size: int = 1) -> int:
            signed = size == 4
            return int.from_bytes(values[address : address + size], "little", signed=signed)

        model = number(registers.MODEL, 2)
        name = registers.MODELS.get(model, "")
        self._pwm_limits[servo] = number(registers.PWM_LIMIT, 2)
        self._amperes[servo] = registers.AMPERES.get(name.partition("-")[0], math.nan)
        self._timed.discard(servo)
        drive = number(registers.DRIVE_MODE)
        if drive & registers.TIMED_PROFILE:
            self._timed.add(servo)
        delay_s = number(registers.REPLY_DELAY) * registers.REPLY_DELAY_S
        self.reply_delay_s = max(self.reply_delay_s, delay_s)
        position = int.from_bytes(self._read(servo, registers.POSITION, 4), "little", signed=True)
        mode, offset = number(registers.MODE), number(registers.OFFSET, 4)
        limits = number(registers.MIN_POSITION, 4), number(registers.MAX_POSITION, 4)
        whole = 0, TICKS_PER_TURN - 1
        firmware = number(registers.FIRMWARE)
        return ServoIdentity(
            servo,
            model,
            name,
            str(firmware),
            offset,
            limits if mode == registers.POSITION_MODE else whole,
            delay_s,
            _trouble(mode, offset, position, limits)
            or _weakness(firmware, drive, self._pwm_limits[servo]),
        )

    def read(self, servos: Sequence[int]) -> Mapping[int, ServoState]:
        if not servos:
            return {}
        asked_ns, size = self._clock.now_ns(), registers.STATE_BYTES
        request = frames.sync_read(registers.STATE, size, list(servos))
        return {
            reply.servo: self._state(asked_ns, reply)
            for reply in self._exchange(request, servos, size)
            if reply.servo in servos and len(reply.data) == size
        }

    def write_goals(self, goals: Mapping[int, Goal]) -> None:
        values = {
            servo: goal.position.to_bytes(_GOAL_BYTES, "little", signed=True)
            for servo, goal in goals.items()
        }
        self._port.send(frames.sync_write(registers.GOAL, _GOAL_BYTES, values))

    def seed(self, servo: int, goal: Goal) -> None:
        # Of a profile in ms nothing is needed: goals come at the speed of the joint.
        velocity = 0 if servo in self._timed else max(1, round(goal.speed / registers.TICKS_S))
        self._write(servo, registers.PROFILE, _SEED.pack(0, velocity, goal.position))

    def set_torque(self, servo: int, *, on: bool) -> None:
        if on:
            periods = round(STOPS_AFTER_S / registers.WATCHDOG_S)
            self._write(servo, registers.WATCHDOG, bytes((periods,)))
            self._armed.add(servo)
        else:
            self._armed.discard(servo)
        self._write(servo, registers.TORQUE, bytes((on,)))
        if not on:  # also what ends the state of one that has expired
            self._write(servo, registers.WATCHDOG, b"\x00")

    def limit_torque(self, servo: int, part: float) -> None:
        limit = round(part * self._pwm_limits.get(servo, registers.FULL_PWM))
        self._write(servo, registers.GOAL_PWM, limit.to_bytes(2, "little"))

    def try_to_clear(self, servo: int) -> None:
        """Restart a servo with a hardware error, which nothing else clears; it is silent then."""
        if self._read(servo, registers.HARDWARE_ERROR, 1) == b"\x00":
            return
        request = frames.frame(servo, frames.REBOOT)
        for _ in range(REBOOT_TRIES):
            if self._exchange(request, [servo], 0):
                return

    def store(self, servo: int, offset: int, range_ticks: tuple[int, int]) -> None:
        low, high = range_ticks
        self.set_torque(servo, on=False)
        mode = self._read(servo, registers.MODE, 1)[0]
        if mode == registers.POSITION_MODE and abs(offset) > registers.MAX_OFFSET:
            self._write(servo, registers.MODE, bytes((registers.EXTENDED_MODE,)))
        self._write(servo, registers.OFFSET, offset.to_bytes(4, "little", signed=True))
        self._write(servo, registers.MAX_POSITION, _LIMITS.pack(high, low))

    def _state(self, asked_ns: int, reply: Reply) -> ServoState:
        torque, error, watchdog, limit, goal, pwm, current, velocity, position, volts, heat = (
            _STATE.unpack(reply.data)
        )
        servo = reply.servo
        return ServoState(
            time_ns=asked_ns,
            position=position,
            velocity=velocity * registers.TICKS_S,
            load=pwm / registers.FULL_PWM,
            goal=goal,
            torque=torque == 1,
            torque_limit=limit / (self._pwm_limits.get(servo) or registers.FULL_PWM),
            voltage_v=volts / 10.0,
            temperature_c=float(heat),
            current_a=current * self._amperes.get(servo, math.nan),
            error=error,
            expired=watchdog == registers.EXPIRED,
            restarted=watchdog == 0 and servo in self._armed,
        )


def _trouble(mode: int, offset: int, position: int, limits: tuple[int, int]) -> str:
    """Return why a servo cannot be driven by position within one turn; "": it can."""
    if mode not in registers.POSITION_MODES:
        name = registers.MODES.get(mode, str(mode))
        return f"is in {name} mode (register 11): write 3 or 4"
    if mode == registers.POSITION_MODE:
        if abs(offset) > registers.MAX_OFFSET:
            what = f"has the offset {offset} (register 20), which position mode ignores"
            return f"{what} beyond ±{registers.MAX_OFFSET}: write 4 to register 11"
        if limits[0] >= limits[1]:
            return f"has no position limits (registers 52 and 48 are {limits[0]} and {limits[1]})"
    if not 0 <= position < TICKS_PER_TURN:
        what = f"is at {position}, which is {position // TICKS_PER_TURN:+} turns off"
        why = "it forgets its turns with the supply"
        advice = "move the joint to the middle of its range by hand, then supply off and on"
        return f"{what}: {why}; {advice}"
    return ""


def _weakness(firmware: int, drive: int, pwm_limit: int) -> str:
    """Return why a servo cannot be driven as safely as others; "": it can."""
    if firmware < registers.WATCHDOG_FIRMWARE:
        needed = registers.WATCHDOG_FIRMWARE
        return f"has the firmware {firmware}, without a bus watchdog: {needed} or newer"
    if drive & registers.GOAL_SWITCHES_ON:
        # Its profile would begin at the old goal, and run on while the torque is still limited.
        return "is switched on by any goal (register 10, bit 3): clear the bit"
    if pwm_limit < registers.LEAST_PWM_LIMIT:
        least = registers.LEAST_PWM_LIMIT
        return f"has the PWM limit {pwm_limit} (register 36): {least} or more"
    return ""
