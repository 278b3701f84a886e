"""CAN frames: copies, error frames in words, and bits on the wire.

A frame with an 11-bit identifier and n data bytes has 47 + 8n bits with the interframe space,
of which 34 + 8n are subject to stuffing: at most one more bit for each four after the first
(Davis, Burns, Bril, Lukkien: Controller Area Network schedulability analysis, 2007, eq. 1).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import can

_ERROR_CLASSES = {  # linux/can/error.h
    0x001: "transmit time-out",
    0x002: "arbitration lost",
    0x004: "controller problem",
    0x008: "protocol violation",
    0x010: "transceiver problem",
    0x020: "no acknowledgement: no other node listens",
    0x040: "bus off",
    0x080: "bus error",
    0x100: "controller restarted",
}
_COUNTERS = 0x200  # data bytes 6 and 7 hold the controller's error counters


class Frame(can.Message):
    """A data frame with an 11-bit identifier, unchecked.

    Cheap to copy: the library's virtual bus copies every frame for every listener, and spends most
    of its time on that with its own frames.
    """

    __slots__ = ()

    def __init__(self, cob_id: int, data: bytes | bytearray) -> None:
        super().__init__(arbitration_id=cob_id, is_extended_id=False, data=bytearray(data))

    def __deepcopy__(self, memo: dict[int, Any] | None) -> Frame:
        twin = Frame(self.arbitration_id, self.data)
        twin.is_remote_frame = self.is_remote_frame
        return twin


def error_frame_text(message: can.Message) -> str:
    """``bus off, 255 transmit and 0 receive errors``; other drivers' frames are just errors."""
    flags = message.arbitration_id
    parts = [text for bit, text in _ERROR_CLASSES.items() if flags & bit] or ["error frame"]
    if flags & _COUNTERS and len(message.data) == 8:
        transmit, receive = message.data[6], message.data[7]
        parts.append(f"{transmit} transmit and {receive} receive errors")
    return ", ".join(parts)


def frame_bits(data_bytes: int) -> int:
    """Return the bits of one data frame on the wire, worst case."""
    return 47 + 8 * data_bytes + (34 + 8 * data_bytes - 1) // 4


def wire_bits(frames: int, data_bytes: int) -> float:
    """Return the bits of ``frames`` frames with ``data_bytes`` in total, worst case."""
    return frames * (47 + 33 / 4) + data_bytes * 10


def bus_load(
    synchronous: Iterable[tuple[int, float]],
    sync_period_s: float,
    heartbeats: int,
    heartbeat_s: float,
    bitrate: int,
) -> float:
    """Return the load of the bus, 1.0 for all of it.

    Args:
        synchronous: data bytes and frames for each SYNC (0.25: each fourth) of every PDO.
        heartbeats: nodes that send one, the master included.
    """
    bits = sum(frame_bits(size) * frames for size, frames in synchronous) + frame_bits(0)
    return (bits / sync_period_s + heartbeats * frame_bits(1) / heartbeat_s) / bitrate
