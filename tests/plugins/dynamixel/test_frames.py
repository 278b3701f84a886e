"""Packets of the maker's e-manual, stuffing, and what damages them."""

from __future__ import annotations

import pytest

from robotd_dynamixel import frames
from robotd_dynamixel.frames import crc16, frame, parse, read, sync_read, sync_write, write
from robotd_dynamixel.registers import fault_remedy, fault_text
from robotd_serial_servo.request_bus import Reply

POSITION_166 = bytes.fromhex("FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0")  # of the e-manual


@pytest.mark.parametrize(
    ("packet", "expected"),
    [
        (frame(1, frames.PING), "FF FF FD 00 01 03 00 01 19 4E"),
        (frame(0xFE, frames.PING), "FF FF FD 00 FE 03 00 01 31 42"),
        (read(1, 132, 4), "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"),
        (write(1, 116, b"\x00\x02\x00\x00"), "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89"),
        (frame(1, frames.REBOOT), "FF FF FD 00 01 03 00 08 2F 4E"),
    ],
)
def test_requests_are_those_of_the_e_manual(packet: bytes, expected: str) -> None:
    assert packet == bytes.fromhex(expected)


def test_requests_for_several_servos_are_those_of_the_sdk() -> None:
    sdk = pytest.importorskip("dynamixel_sdk")
    handler, reads, writes = sdk.PacketHandler(2.0), _Recorder(), _Recorder()
    handler.syncReadTx(reads, 132, 4, [1, 2], 2, False)
    handler.syncWriteTxOnly(writes, 116, 4, [1, 0, 2, 0, 0, 2, 7, 0, 0, 0], 10)
    goals = {1: b"\x00\x02\x00\x00", 2: b"\x07\x00\x00\x00"}
    assert reads.sent == [sync_read(132, 4, [1, 2])]
    assert writes.sent == [sync_write(116, 4, goals)]


def test_a_reply_is_found_behind_noise_and_in_pieces() -> None:
    found = parse(b"\x00\xff\xff" + POSITION_166, 4)
    assert found.replies == [Reply(1, 0, b"\xa6\x00\x00\x00")]
    for cut in range(1, len(POSITION_166)):
        first = parse(POSITION_166[:cut], 4)
        assert first.replies == []
        assert parse(first.rest + POSITION_166[cut:], 4).replies == found.replies


def test_the_confirmation_of_a_ping_and_of_a_write() -> None:
    ping = bytes.fromhex("FF FF FD 00 01 07 00 55 00 06 04 26 65 5D")
    assert parse(ping, 3).replies == [Reply(1, 0, b"\x06\x04\x26")]
    written = bytes.fromhex("FF FF FD 00 01 04 00 55 00 A1 0C")
    assert parse(written, 0).replies == [Reply(1, 0, b"")]


def test_stuffed_data_is_as_it_was() -> None:
    data = b"\xff\xff\xfd\xff\xff\xfd\x00\xfd"
    packet = frame(3, frames.STATUS, b"\x00" + data)
    assert packet.count(b"\xff\xff\xfd\xfd") == 2
    assert int.from_bytes(packet[5:7], "little") == len(data) + 4 + 2
    assert parse(packet, len(data)).replies == [Reply(3, 0, data)]


@pytest.mark.parametrize("place", range(4, 15))
def test_a_flipped_bit_costs_one_reply_alone(place: int) -> None:
    damaged, second = bytearray(POSITION_166), bytearray(POSITION_166[:-2])
    second[4] = 2
    whole = bytes(second) + crc16(bytes(second)).to_bytes(2, "little")
    damaged[place] ^= 0x04
    found = parse(bytes(damaged) + whole, 4)
    assert found.replies == [Reply(2, 0, b"\xa6\x00\x00\x00")]
    assert found.corrupt >= 1


def test_an_echo_is_no_reply() -> None:
    assert parse(read(1, 132, 4), 4).replies == []


def test_hardware_errors_have_words_and_remedies() -> None:
    assert fault_text(0x21) == "supply voltage out of range, overload"
    assert "restarts the servo without torque" in fault_remedy(0x20)


class _Recorder:
    """A port of the SDK that keeps what is sent."""

    is_using = False

    def __init__(self) -> None:
        self.sent: list[bytes] = []

    def clearPort(self) -> None:  # noqa: N802
        pass

    def writePort(self, packet: list[int]) -> int:  # noqa: N802
        self.sent.append(bytes(packet))
        return len(packet)

    def setPacketTimeout(self, length: int) -> None:  # noqa: N802
        pass
