"""Bus of simulated Dynamixel X servos on a pseudo-terminal: protocol 2.0.

    with DxlBus({1: Servo("xl430-w250"), 2: Servo("xl330-m288", angle=0.4)}) as bus:
        client = open_client(bus.port)      # 1 Mbit/s, 8N1

Used as ``StsBus``; see README.md in this folder.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from random import Random

from tests.plugins.serial_servo.dxl_servo import BAUDS, INSTRUCTION, LENGTH, Servo
from tests.plugins.serial_servo.faults import flip_a_bit
from tests.plugins.serial_servo.serial_line import SerialLine

HEADER = b"\xff\xff\xfd\x00"
BROADCAST = 254
LONGEST = 1024

PING, READ, WRITE, STAGE, ACTION, FACTORY_RESET, REBOOT, CLEAR = 1, 2, 3, 4, 5, 6, 8, 0x10
STATUS = 0x55
SYNC_READ, SYNC_WRITE, FAST_SYNC_READ = 0x82, 0x83, 0x8A
BULK_READ, BULK_WRITE, FAST_BULK_READ = 0x92, 0x93, 0x9A
CLEAR_TURNS = b"\x01\x44\x58\x4c\x22"


def shifted(crc: int) -> int:
    """Return ``crc`` after eight more bits of 0: polynomial 0x8005, most significant bit first."""
    for _ in range(8):
        crc = (crc << 1 ^ (0x8005 if crc & 0x8000 else 0)) & 0xFFFF
    return crc


CRCS = [shifted(byte << 8) for byte in range(256)]


def crc16(data: bytes) -> int:
    """Return the CRC of protocol 2.0, which begins with 0."""
    crc = 0
    for byte in data:
        crc = (crc << 8 & 0xFFFF) ^ CRCS[crc >> 8 ^ byte]
    return crc


def sealed(data: bytes) -> bytes:
    """Return ``data`` with its CRC."""
    return data + crc16(data).to_bytes(2, "little")


def packet(device: int, body: bytes) -> bytes:
    """Return a packet: header, id, length, ``body`` with byte stuffing, CRC."""
    stuffed = body.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")
    return sealed(HEADER + struct.pack("<BH", device, len(stuffed) + 2) + stuffed)


def status(device: int, error: int, data: bytes = b"") -> bytes:
    return packet(device, bytes([STATUS, error]) + data)


def unpacked(frame: bytes) -> bytes:
    """Return instruction and parameters of a packet, without byte stuffing."""
    return frame[7:-2].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")


class DxlBus(SerialLine):
    """Dynamixel X servos by key. A servo's id is its key unless it has been given another one."""

    servos: dict[int, Servo]  # type: ignore[assignment]

    def __init__(self, servos: Mapping[int, Servo], *, seed: int = 0) -> None:
        for key, servo in servos.items():
            if servo.given_id is None:
                servo.set("id", key)
        super().__init__(servos, seed=seed)

    def __getitem__(self, key: int) -> Servo:
        return self.servos[key]

    # Packets

    def next_frame(self, received: bytearray) -> bytes | None:
        while True:
            start = received.find(HEADER)
            if start < 0:
                del received[: max(len(received) - 3, 0)]
                return None
            del received[:start]
            if len(received) < 7:
                return None
            (length,) = struct.unpack_from("<H", received, 5)
            if not 3 <= length <= LONGEST:
                del received[0]
                continue
            if len(received) < length + 7:
                return None
            frame = bytes(received[: length + 7])
            if frame == sealed(frame[:-2]):
                del received[: length + 7]
                return frame
            del received[0]

    def with_id(self, frame: bytes, servo_id: int) -> bytes:
        return packet(servo_id % 253, unpacked(frame))

    def falsified(self, frame: bytes, random: Random) -> bytes:
        body = unpacked(frame)
        return packet(frame[4], flip_a_bit(body, random, 2)) if len(body) > 2 else frame

    # Instructions

    def addressed(self, device: int) -> list[Servo]:
        """Return the servos that a packet to ``device`` reaches, secondary ids too."""
        return [
            servo
            for servo in self.servos.values()
            if device in {servo.id, servo.get("secondary_id"), BROADCAST}
            and self.receives(servo, BAUDS[servo.get("baud")])
        ]

    def execute(self, frame: bytes, end: float) -> None:
        device, body = frame[4], unpacked(frame)
        instruction, data = body[0], body[1:]
        for servo in self.servos.values():
            servo.notice_instruction()
        if instruction in {SYNC_READ, FAST_SYNC_READ, BULK_READ, FAST_BULK_READ}:
            self._read_many(instruction, data, end)
        elif instruction in {SYNC_WRITE, BULK_WRITE}:
            for servo_id, address, block in self._blocks(instruction, data):
                for servo in self.addressed(servo_id):
                    servo.write(address, block)
        elif instruction == PING and device == BROADCAST:
            for servo in sorted(self.addressed(BROADCAST), key=lambda servo: servo.id):
                answer = self._answer(servo, PING, b"") or b""
                end = self.reply([(servo, answer)], end + servo.return_delay_s())
        else:
            self._one(device, instruction, data, end)

    def _one(self, device: int, instruction: int, data: bytes, end: float) -> None:
        if device == BROADCAST and instruction == FACTORY_RESET and data == b"\xff":
            return
        answers = [
            (servo, answer)
            for servo in self.addressed(device)
            if (answer := self._answer(servo, instruction, data)) is not None
            and device == int.from_bytes(answer[4:5], "little")
        ]
        if answers and device != BROADCAST:
            self.reply(answers, end + max(servo.return_delay_s() for servo, _ in answers))

    def _answer(self, servo: Servo, instruction: int, data: bytes) -> bytes | None:
        """Execute an instruction; return the status packet, or None for no reply."""
        servo_id, level = servo.id, servo.get("return_level")
        if instruction == PING:
            number = struct.pack("<HB", servo.get("model"), servo.get("firmware"))
            return status(servo_id, servo.alert, number)
        if instruction == READ:
            if len(data) != 4:
                return status(servo_id, servo.alert | LENGTH) if level else None
            address, count = struct.unpack("<HH", data)
            count = min(count, LONGEST)
            return status(servo_id, servo.alert, servo.read(address, count)) if level else None
        alert = servo.alert  # a reboot would clear it
        error = self._executed(servo, instruction, data)
        return status(servo_id, alert | error) if level == 2 else None

    @staticmethod
    def _executed(servo: Servo, instruction: int, data: bytes) -> int:
        """Execute an instruction that returns no data; return the error number."""
        if instruction in {WRITE, STAGE} and len(data) > 2:
            address = int.from_bytes(data[:2], "little")
            return (servo.write if instruction == WRITE else servo.stage)(address, data[2:])
        if instruction == ACTION:
            return servo.act()
        if instruction == CLEAR and data == CLEAR_TURNS:
            return servo.clear_turns()
        if instruction == REBOOT:
            servo.reboot()
            return 0
        if instruction == FACTORY_RESET and len(data) == 1:
            servo.restore_factory_settings({1: {"id"}, 2: {"id", "baud"}}.get(data[0], set()))
            return 0
        return INSTRUCTION

    @staticmethod
    def _blocks(instruction: int, data: bytes) -> Iterable[tuple[int, int, bytes]]:
        """Yield id, address and data of each part of a sync or bulk write."""
        if instruction == SYNC_WRITE:
            address, count = struct.unpack_from("<HH", data.ljust(4, b"\0"))
            for start in range(4, len(data) - count, count + 1):
                yield data[start], address, data[start + 1 : start + 1 + count]
            return
        start = 0
        while start + 5 <= len(data):
            servo_id, address, count = struct.unpack_from("<BHH", data, start)
            yield servo_id, address, data[start + 5 : start + 5 + count]
            start += 5 + count

    def _read_many(self, instruction: int, data: bytes, end: float) -> None:
        if instruction in {SYNC_READ, FAST_SYNC_READ}:
            address, count = struct.unpack_from("<HH", data.ljust(4, b"\0"))
            parts = [(servo_id, address, count) for servo_id in data[4:]]
        else:
            parts = list(struct.iter_unpack("<BHH", data[: len(data) // 5 * 5]))
        if sum(count + 4 for _, _, count in parts) > LONGEST:
            return
        if instruction in {FAST_SYNC_READ, FAST_BULK_READ}:
            self._fast(parts, end)
            return
        for servo_id, address, count in parts:
            answers = [
                (servo, status(servo.id, servo.alert, servo.read(address, count)))
                for servo in self.addressed(servo_id)
                if servo.id == servo_id and servo.get("return_level")
            ]
            if answers:
                end = self.reply(answers, end + max(item.return_delay_s() for item, _ in answers))
            elif self.knobs.after_missing == "stop":
                return

    def _fast(self, parts: Sequence[tuple[int, int, int]], end: float) -> None:
        """Reply with one packet for all. It ends where a servo is missing: those after it wait."""
        length = 1 + sum(count + 4 for _, _, count in parts)
        frame = HEADER + struct.pack("<BHB", BROADCAST, length, STATUS)
        first = None
        for servo_id, address, count in parts:
            servos = [servo for servo in self.addressed(servo_id) if servo.id == servo_id]
            if not servos:
                break
            servo = servos[0]
            first = first or servo
            block = bytes([servo.alert, servo_id]) + servo.read(address, count)
            frame = sealed(frame + block)
        if first is not None:
            self.reply([(first, frame)], end + first.return_delay_s())
