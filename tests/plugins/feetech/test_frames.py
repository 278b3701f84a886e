"""Frames by hand, from the makers' protocol text and memory table."""

from __future__ import annotations

import pytest

from robotd_feetech.frames import (
    PING,
    READ,
    frame,
    parse,
    signed,
    sync_write,
    unsigned,
)
from robotd_feetech.registers import fault_remedy, fault_text
from robotd_serial_servo.request_bus import Reply


def test_requests_are_those_of_the_makers_text() -> None:
    assert frame(1, PING) == bytes.fromhex("FF FF 01 02 01 FB")
    assert frame(1, READ, b"\x38\x02") == bytes.fromhex("FF FF 01 04 02 38 02 BE")


def test_goals_of_several_servos_are_one_frame() -> None:
    goals = {number: bytes.fromhex("00 08 00 00 E8 03") for number in (1, 2, 3, 4)}
    expected = "FF FF FE 20 83 2A 06" + "".join(
        f" {number:02X} 00 08 00 00 E8 03" for number in goals
    )
    assert sync_write(0x2A, 6, goals) == bytes.fromhex(expected + " 58")


def test_a_reply_is_found_behind_noise_and_pieces() -> None:
    reply = bytes.fromhex("FF FF 01 04 00 18 05 DD")
    found = parse(b"\x00\xff" + reply, 2)
    assert found.replies == [Reply(1, 0, b"\x18\x05")]
    first = parse(reply[:5], 2)
    assert first.replies == []
    assert parse(first.rest + reply[5:], 2).replies == [Reply(1, 0, b"\x18\x05")]


@pytest.mark.parametrize("place", range(2, 8))
def test_a_flipped_bit_costs_one_reply_alone(place: int) -> None:
    first, second = (bytearray.fromhex(f"FF FF 0{n} 04 00 18 05 D{0xE - n:X}") for n in (1, 2))
    first[place] ^= 0x04
    found = parse(bytes(first + second), 2)
    assert found.replies == [Reply(2, 0, b"\x18\x05")]
    assert found.corrupt >= 1


def test_a_fault_is_a_reply_with_data() -> None:
    (reply,) = parse(bytes.fromhex("FF FF 01 04 20 18 05 BD"), 2).replies
    assert reply == Reply(1, 0x20, b"\x18\x05")
    assert fault_text(reply.error) == "overload"
    assert "supply off and on" in fault_remedy(reply.error)


@pytest.mark.parametrize(("value", "bit"), [(0, 15), (-5, 15), (300, 10), (-2047, 11)])
def test_signs_are_a_bit(value: int, bit: int) -> None:
    assert signed(unsigned(value, bit), bit) == value
    assert unsigned(-5, 15) == 0x8005
