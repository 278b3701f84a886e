"""Frames of the Dynamixel protocol 2.0: ``FF FF FD 00 id length instruction parameters crc``."""

from __future__ import annotations

from robotd_serial_servo.request_bus import Parsed, Reply

HEADER = b"\xff\xff\xfd\x00"
BROADCAST = 0xFE
MAX_ID = 252
PING, READ, WRITE, REBOOT, SYNC_READ, SYNC_WRITE = 0x01, 0x02, 0x03, 0x08, 0x82, 0x83
STATUS = 0x55
OVERHEAD = 11  # bytes of a status packet without data
POLYNOMIAL = 0x8005
ALERT = 0x80  # of the error byte: there is a hardware error; the data is valid
ERRORS = {
    1: "the instruction failed",
    2: "the instruction is not known",
    3: "the checksum was wrong",
    4: "the value is out of range",
    5: "the value is too short",
    6: "the value is beyond a limit",
    7: "no access: torque is on, or there is no such register",
}

_PREFIX = 7  # bytes before the instruction
_PATTERN, _STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"


def _table() -> tuple[int, ...]:
    values = []
    for byte in range(256):
        value = byte << 8
        for _ in range(8):
            value = (value << 1) ^ (POLYNOMIAL if value & 0x8000 else 0)
        values.append(value & 0xFFFF)
    return tuple(values)


_TABLE = _table()


def crc16(data: bytes) -> int:
    """Return the checksum of a packet up to its parameters."""
    crc = 0
    for byte in data:
        crc = (crc << 8 & 0xFFFF) ^ _TABLE[crc >> 8 ^ byte]
    return crc


def frame(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return the packet of one instruction."""
    content = (bytes((instruction,)) + parameters).replace(_PATTERN, _STUFFED)
    packet = HEADER + bytes((servo,)) + (len(content) + 2).to_bytes(2, "little") + content
    return packet + crc16(packet).to_bytes(2, "little")


def sync_read(address: int, size: int, servos: list[int]) -> bytes:
    """Return the packet that asks each servo for ``size`` bytes at ``address``."""
    return frame(BROADCAST, SYNC_READ, _words(address, size) + bytes(servos))


def sync_write(address: int, size: int, values: dict[int, bytes]) -> bytes:
    """Return the packet that writes ``size`` bytes at ``address`` of each servo."""
    body = b"".join(bytes((servo,)) + data for servo, data in values.items())
    return frame(BROADCAST, SYNC_WRITE, _words(address, size) + body)


def read(servo: int, address: int, size: int) -> bytes:
    """Return the packet that reads registers of one servo."""
    return frame(servo, READ, _words(address, size))


def write(servo: int, address: int, data: bytes) -> bytes:
    """Return the packet that writes registers of one servo."""
    return frame(servo, WRITE, address.to_bytes(2, "little") + data)


def parse(line: bytes, size: int) -> Parsed:
    """Find status packets with ``size`` bytes of data, or none, in ``line``; others are damaged.

    What is damaged is skipped byte by byte, so that the replies after it are found.
    """
    replies, corrupt, start = [], 0, 0
    longest = (size + 4) * 4 // 3  # with stuffing
    while (start := line.find(HEADER, start)) >= 0:
        if len(line) < start + _PREFIX:
            break
        servo, length = line[start + 4], int.from_bytes(line[start + 5 : start + 7], "little")
        end = start + _PREFIX + length
        if servo > MAX_ID or not 4 <= length <= longest:
            corrupt, start = corrupt + 1, start + 1
            continue
        if len(line) < end:
            break
        content = line[start + _PREFIX : end - 2].replace(_STUFFED, _PATTERN)
        whole = crc16(line[start : end - 2]) == int.from_bytes(line[end - 2 : end], "little")
        if whole and content[0] == STATUS and len(content) - 2 in {0, size}:
            replies.append(Reply(servo, content[1], content[2:]))
            start = end
        else:
            corrupt, start = corrupt + 1, start + 1
    return Parsed(replies, line[start:] if start >= 0 else line[-3:], corrupt)


def _words(*values: int) -> bytes:
    return b"".join(value.to_bytes(2, "little") for value in values)
