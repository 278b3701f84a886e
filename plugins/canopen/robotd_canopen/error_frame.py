"""Text of an error frame in the layout of SocketCAN (linux/can/error.h)."""

from __future__ import annotations

import can

_CLASSES = {
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


def error_frame_text(message: can.Message) -> str:
    """``bus off, 255 transmit and 0 receive errors``; other drivers' frames are just errors."""
    flags = message.arbitration_id
    parts = [text for bit, text in _CLASSES.items() if flags & bit] or ["error frame"]
    if flags & _COUNTERS and len(message.data) == 8:
        transmit, receive = message.data[6], message.data[7]
        parts.append(f"{transmit} transmit and {receive} receive errors")
    return ", ".join(parts)
