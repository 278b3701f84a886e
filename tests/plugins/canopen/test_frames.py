"""Frames: copies, error frames in words, and their length on the wire."""

from __future__ import annotations

from copy import deepcopy

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotd_canopen.frame import Frame, bus_load, error_frame_text, frame_bits, wire_bits


@given(st.integers(0, 0x7FF), st.binary(max_size=8), st.booleans())
def test_a_copy_is_as_the_library_makes_it(cob_id: int, data: bytes, remote: bool) -> None:
    frame = Frame(cob_id, b"" if remote else data)
    frame.is_remote_frame = remote
    twin = deepcopy(frame)
    assert twin.equals(can.Message.__deepcopy__(frame, {}))
    assert twin.data is not frame.data


@pytest.mark.parametrize(
    ("flags", "data", "text"),
    [
        (0x20, bytes(8), "no acknowledgement: no other node listens"),
        (0x240, bytes([0] * 6 + [248, 3]), "bus off, 248 transmit and 3 receive errors"),
        (0x104, bytes(8), "controller problem, controller restarted"),
        (0, b"", "error frame"),
    ],
)
def test_error_frames_in_words(flags: int, data: bytes, text: str) -> None:
    message = can.Message(arbitration_id=flags, data=data, is_error_frame=True)
    assert error_frame_text(message) == text


@given(st.lists(st.integers(0, 8), max_size=30))
def test_bits_on_the_wire(sizes: list[int]) -> None:
    exact = sum(map(frame_bits, sizes))
    assert exact <= wire_bits(len(sizes), sum(sizes)) <= exact + len(sizes)


def test_worst_case_bits_of_a_frame() -> None:
    assert frame_bits(0) == 55  # 47 + 33 // 4
    assert frame_bits(8) == 135  # the figure of the literature for eight bytes


def test_a_full_second_of_frames_is_the_whole_bus() -> None:
    frames = 125_000 / frame_bits(8)
    load = bus_load([(8, frames)], 1.0, 0, 1.0, 125_000)
    assert abs(load - 1.0 - frame_bits(0) / 125_000) < 1e-9
