"""Frames of the Feetech protocol: ``FF FF id length instruction parameters sum``."""

from __future__ import annotations

from robotd_serial_servo.request_bus import Parsed, Reply

HEADER = b"\xff\xff"
BROADCAST = 0xFE
MAX_ID = 252
PING, READ, WRITE, SYNC_READ, SYNC_WRITE = 0x01, 0x02, 0x03, 0x82, 0x83
OVERHEAD = 6  # bytes of a frame without parameters


def checksum(content: bytes) -> int:
    """Return the sum of a frame whose bytes between header and sum are ``content``."""
    return ~sum(content) & 0xFF


def frame(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return the frame of one instruction; up to 250 bytes of parameters."""
    content = bytes((servo, len(parameters) + 2, instruction)) + parameters
    return HEADER + content + bytes((checksum(content),))


def sync_write(address: int, size: int, values: dict[int, bytes]) -> bytes:
    """Return the frame that writes ``size`` bytes at ``address`` of each servo."""
    body = b"".join(bytes((servo,)) + data for servo, data in values.items())
    return frame(BROADCAST, SYNC_WRITE, bytes((address, size)) + body)


def parse(line: bytes, size: int) -> Parsed:
    """Find the replies with ``size`` bytes of data in ``line``; others are damaged, and counted.

    What is damaged is skipped byte by byte, so that the replies after it are found. The error byte
    of a reply is the servo's status; its data is valid also with a fault.
    """
    replies, corrupt, start = [], 0, 0
    while (start := line.find(HEADER, start)) >= 0:
        if line[start + 2 : start + 3] == b"\xff":  # one more FF before the header
            start += 1
            continue
        head = line[start + 2 : start + 4]
        if len(head) < 2:
            break
        servo, length = head
        if length != size + 2 or servo > MAX_ID + 1:
            corrupt, start = corrupt + 1, start + 1
            continue
        end = start + 4 + length
        if len(line) < end:
            break
        if checksum(line[start + 2 : end - 1]) == line[end - 1]:
            replies.append(Reply(servo, line[start + 4], line[start + 5 : end - 1]))
            start = end
        else:
            corrupt, start = corrupt + 1, start + 1
    rest = line[start:] if start >= 0 else line[-1:] if line.endswith(b"\xff") else b""
    return Parsed(replies, rest, corrupt)


def signed(value: int, bit: int) -> int:
    """Return the number of a register in sign and magnitude, whose sign is in ``bit``."""
    magnitude = value & ((1 << bit) - 1)
    return -magnitude if value >> bit & 1 else magnitude


def unsigned(value: int, bit: int) -> int:
    """Return the register of ``value`` in sign and magnitude."""
    return -value | 1 << bit if value < 0 else value
