"""STS and SMS servos on a serial port."""

from __future__ import annotations

import struct
import time
from collections.abc import Mapping, Sequence

from robotd.api import Clock
from robotd_feetech import registers
from robotd_feetech.frames import (
    BROADCAST,
    OVERHEAD,
    PING,
    READ,
    SYNC_READ,
    WRITE,
    frame,
    parse,
    signed,
    sync_write,
    unsigned,
)
from robotd_serial_servo.request_bus import Parsed, Reply, RequestBus
from robotd_serial_servo.serial_port import SerialPort
from robotd_serial_servo.servo_bus import (
    BusError,
    Goal,
    ServoIdentity,
    ServoState,
)

STORE_S = 0.02  # a servo writes its EEPROM; a position read just after may be 0
STORE_TIMEOUT_S = 2.0
SYNC_GOAL = struct.Struct("<BHHH")  # from ACCELERATION on: ramp, goal, time, speed
GOAL_HEAD = struct.Struct("<BH")


class StsBus(RequestBus):
    """STS and SMS servos, which are low byte first and know sync read. One thread at a time."""

    overhead = OVERHEAD

    def __init__(self, port: SerialPort, clock: Clock, reply_timeout_s: float) -> None:
        super().__init__(port, clock, reply_timeout_s)
        self._speed_units: dict[int, int] = {}  # steps/s of each servo that was identified

    def _parse(self, line: bytes, size: int) -> Parsed:
        return parse(line, size)

    def _ping_frame(self, servo: int) -> bytes:
        return frame(servo, PING)

    def _read_frame(self, servo: int, address: int, size: int) -> bytes:
        return frame(servo, READ, bytes((address, size)))

    def _write_frame(self, servo: int, address: int, data: bytes) -> bytes:
        return frame(servo, WRITE, bytes((address,)) + data)

    def identify(self, servo: int) -> ServoIdentity:
        values = self._read(servo, 0, registers.SETTINGS_BYTES)

        def word(address: int) -> int:
            return int.from_bytes(values[address : address + 2], "little")

        low, high = word(registers.MIN_ANGLE), word(registers.MAX_ANGLE)
        mode, trouble = values[registers.MODE], ""
        if mode:
            name = registers.MODES.get(mode, str(mode))
            trouble = f"is in {name} mode (register 33): write 0"
        elif values[registers.PHASE] & registers.BEYOND_ONE_TURN:
            trouble = "counts beyond one turn (register 18, bit 4): clear the bit"
        elif low >= high:
            trouble = f"has no angle limits (registers 9 and 11 are {low} and {high}): calibrate it"
        in_steps = values[registers.PHASE] & registers.SPEED_IN_STEPS
        self._speed_units[servo] = 1 if in_steps else registers.COARSE_SPEED
        delay_s = values[registers.REPLY_DELAY] * registers.REPLY_DELAY_S
        self.reply_delay_s = max(self.reply_delay_s, delay_s)
        model = word(registers.MODEL)
        return ServoIdentity(
            servo,
            model,
            registers.MODELS.get(model, ""),
            f"{values[0]}.{values[1]}",
            signed(word(registers.OFFSET), registers.OFFSET_SIGN),
            (low, high),
            delay_s,
            trouble,
        )

    def read(self, servos: Sequence[int]) -> Mapping[int, ServoState]:
        if not servos:
            return {}
        asked_ns, size = self._clock.now_ns(), registers.STATE_BYTES
        request = frame(BROADCAST, SYNC_READ, bytes((registers.STATE, size, *servos)))
        replies = self._exchange(request, servos, size)
        return {
            reply.servo: _state(asked_ns, reply, self._speed_units.get(reply.servo, 1))
            for reply in replies
            if reply.servo in servos and len(reply.data) == size
        }

    def write_goals(self, goals: Mapping[int, Goal]) -> None:
        values = {servo: self._goal(servo, goal) for servo, goal in goals.items()}
        self._port.send(sync_write(registers.ACCELERATION, SYNC_GOAL.size, values))

    def seed(self, servo: int, goal: Goal) -> None:
        data = self._goal(servo, goal)
        # The speed is not compared: a servo may show the one that it has reached instead.
        self._write(servo, registers.ACCELERATION, data, compare=GOAL_HEAD.size)

    def _goal(self, servo: int, goal: Goal) -> bytes:
        # A speed of 0 would not be a limit.
        speed = max(1, goal.speed // self._speed_units.get(servo, 1))
        position = unsigned(goal.position, registers.SIGN)
        return SYNC_GOAL.pack(registers.FASTEST_RAMP, position, 0, speed)

    def set_torque(self, servo: int, *, on: bool) -> None:
        self._write(servo, registers.TORQUE, bytes((on,)))

    def limit_torque(self, servo: int, part: float) -> None:
        limit = round(part * registers.FULL_TORQUE)
        self._write(servo, registers.TORQUE_LIMIT, limit.to_bytes(2, "little"))

    def try_to_clear(self, servo: int) -> None:
        self.set_torque(servo, on=False)

    def store(self, servo: int, offset: int, range_ticks: tuple[int, int]) -> None:
        if abs(offset) > registers.MAX_OFFSET:
            what = f"servo {servo}: offset {offset} does not fit into its register"
            raise BusError(f"{what} (±{registers.MAX_OFFSET}): mount the horn half a turn further")
        low, high = range_ticks
        written = unsigned(offset, registers.OFFSET_SIGN)
        self.set_torque(servo, on=False)
        self._write(servo, registers.LOCK, b"\x00")
        try:
            self._store(servo, registers.OFFSET, written.to_bytes(2, "little"))
            self._store(servo, registers.MIN_ANGLE, struct.pack("<HH", low, high))
        finally:
            self._write(servo, registers.LOCK, b"\x01")

    def _store(self, servo: int, address: int, data: bytes) -> None:
        """Write what survives power-off; the servo is busy with it for up to two seconds."""
        end = time.monotonic() + STORE_TIMEOUT_S
        while True:
            try:
                self._write(servo, address, data)
            except BusError:
                if time.monotonic() > end:
                    raise
                time.sleep(STORE_S)
            else:
                return


def _state(asked_ns: int, reply: Reply, speed_unit: int) -> ServoState:
    data = reply.data

    def byte(address: int) -> int:
        return data[address - registers.STATE]

    def word(address: int, sign: int = registers.SIGN) -> int:
        start = address - registers.STATE
        return signed(int.from_bytes(data[start : start + 2], "little"), sign)

    return ServoState(
        time_ns=asked_ns,
        position=word(registers.POSITION),
        velocity=float(word(registers.SPEED) * speed_unit),
        load=word(registers.LOAD, registers.LOAD_SIGN) / registers.FULL_TORQUE,
        goal=word(registers.GOAL),
        torque=byte(registers.TORQUE) == 1,
        torque_limit=word(registers.TORQUE_LIMIT) / registers.FULL_TORQUE,
        voltage_v=byte(registers.VOLTAGE) / 10.0,
        temperature_c=float(byte(registers.TEMPERATURE)),
        current_a=word(registers.CURRENT) * registers.AMPERES,
        error=reply.error | byte(registers.STATUS),
    )
