"""Bus of simulated Feetech STS servos on a pseudo-terminal: frames and instructions.

    with StsBus({1: Servo(model="sts3215"), 2: Servo(angle=0.4)}) as bus:
        client = open_client(bus.port)      # 1 Mbit/s, 8N1
        bus.arm[1].move(0.3)                # by hand
        bus[2].power_off()                  # silent servo
        bus[1].faults.force("drop", 2)      # the next two replies are lost
        bus.knobs.echo = True
        bus[1].writes, bus[1].executed      # to judge motion at the servo

See README.md in this folder for all knobs and for what is not modelled.
"""

from __future__ import annotations

from collections.abc import Mapping
from random import Random

from tests.plugins.serial_servo.faults import flip_a_bit
from tests.plugins.serial_servo.serial_line import SerialLine
from tests.plugins.serial_servo.sts_servo import BAUDS, Servo

HEADER = b"\xff\xff"
BROADCAST = 254
LONGEST = 250
"""Data bytes of the longest reply."""

PING, READ, WRITE, STAGE, ACTION, FACTORY_RESET, REBOOT = 1, 2, 3, 4, 5, 6, 8
SYNC_READ, SYNC_WRITE = 0x82, 0x83


def framed(servo_id: int, body: bytes) -> bytes:
    """Return a frame: header, id, length, ``body`` (instruction or error byte, data), checksum."""
    inner = bytes([servo_id, len(body) + 1]) + body
    return HEADER + inner + bytes([~sum(inner) & 0xFF])


class StsBus(SerialLine):
    """STS servos by key. A servo's id is its key unless it has been given another one."""

    servos: dict[int, Servo]  # type: ignore[assignment]

    def __init__(self, servos: Mapping[int, Servo], *, seed: int = 0) -> None:
        for key, servo in servos.items():
            if servo.given_id is None:
                servo.set("id", key)
        super().__init__(servos, seed=seed)

    def __getitem__(self, key: int) -> Servo:
        return self.servos[key]

    # Frames

    def next_frame(self, received: bytearray) -> bytes | None:
        while True:
            start = received.find(HEADER)
            if start < 0:
                del received[: -1 if received.endswith(b"\xff") else len(received)]
                return None
            del received[:start]
            if len(received) < 4:
                return None
            length = received[3]
            if received[2] > BROADCAST or length < 2:
                del received[0]
                continue
            if len(received) < length + 4:
                return None
            frame = bytes(received[: length + 4])
            if frame == framed(frame[2], frame[4:-1]):
                del received[: length + 4]
                return frame
            del received[0]

    def with_id(self, frame: bytes, servo_id: int) -> bytes:
        return framed(servo_id % 253, frame[4:-1])

    def falsified(self, frame: bytes, random: Random) -> bytes:
        body = frame[4:-1]
        return framed(frame[2], flip_a_bit(body, random, 1)) if len(body) > 1 else frame

    # Instructions

    def addressed(self, servo_id: int) -> list[Servo]:
        """Return the servos that a request with ``servo_id`` reaches."""
        return [
            servo
            for servo in self.servos.values()
            if servo_id in {servo.id, BROADCAST}
            and self.receives(servo, BAUDS[servo.get("baud") & 7])
        ]

    def execute(self, frame: bytes, end: float) -> None:
        servo_id, instruction, data = frame[2], frame[4], frame[5:-1]
        if instruction == SYNC_READ:
            self._sync_read(data, end)
        elif instruction == SYNC_WRITE:
            self._sync_write(data)
        elif instruction == PING and servo_id == BROADCAST:
            # Two clients of others rely on replies in turn: LeRobot's scan and rustypot's.
            for servo in sorted(self.addressed(BROADCAST), key=lambda servo: servo.id):
                answer = framed(servo.id, bytes([servo.get("status")]))
                end = self.reply([(servo, answer)], end + servo.return_delay_s())
        else:
            answers = [
                (servo, framed(servo_id, body))
                for servo in self.addressed(servo_id)
                if (body := self._answer(servo, instruction, data)) is not None
            ]
            if answers and servo_id != BROADCAST:
                self.reply(answers, end + max(item.return_delay_s() for item, _ in answers))

    def _answer(self, servo: Servo, instruction: int, data: bytes) -> bytes | None:
        """Execute an instruction; return error byte and data, or None for no reply."""
        error = bytes([servo.get("status")])
        if instruction == PING:
            return error
        if instruction == READ and len(data) == 2 and data[1] <= LONGEST:
            return error + servo.read(data[0], data[1])
        answers = servo.get("reply_level") > 0
        if instruction == WRITE and len(data) > 1:
            servo.write(data[0], data[1:])
            # A change of the reply level holds for its own reply.
            answers = servo.get("reply_level") > 0
        elif instruction == STAGE and len(data) > 1:
            servo.stage(data[0], data[1:])
        elif instruction == ACTION:
            servo.act()
        elif instruction == FACTORY_RESET:
            servo.restore_factory_settings()
        elif instruction == REBOOT:
            servo.reboot()
            return None
        else:
            return None
        return error if answers else None

    def _sync_read(self, data: bytes, end: float) -> None:
        if len(data) < 3 or data[1] > LONGEST:
            return
        address, count = data[0], data[1]
        for servo_id in data[2:]:
            servos = self.addressed(servo_id) if servo_id != BROADCAST else []
            if not servos and self.knobs.after_missing == "stop":
                return
            answers = [
                (servo, framed(servo.id, bytes([servo.get("status")]) + servo.read(address, count)))
                for servo in servos
            ]
            if answers:
                end = self.reply(answers, end + max(item.return_delay_s() for item, _ in answers))

    def _sync_write(self, data: bytes) -> None:
        if len(data) < 3:
            return
        address, count = data[0], data[1]
        for start in range(2, len(data) - count, count + 1):
            for servo in self.addressed(data[start]):
                servo.write(address, data[start + 1 : start + 1 + count])
