"""Messages to the viewers of a page, and their WebSocket frames."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Mapping
from typing import Any

Message = str | bytes
"""JSON text, or samples as ``LiveSamples`` makes them."""

TEXT, BINARY = 0x81, 0x82  # first byte of a frame that is a whole message (RFC 6455, 5.2)


def json_text(message: Mapping[str, Any]) -> str:
    """Return ``message`` as JSON without spaces."""
    return json.dumps(message, separators=(",", ":"))


def websocket_frames(messages: Iterable[Message]) -> bytes:
    """Return messages as frames of a server, made once for all viewers."""
    return b"".join(map(_frame, messages))


def _frame(message: Message) -> bytes:
    opcode, data = (TEXT, message.encode()) if isinstance(message, str) else (BINARY, message)
    size = len(data)
    if size < 126:
        return struct.pack("!BB", opcode, size) + data
    if size < 2**16:
        return struct.pack("!BBH", opcode, 126, size) + data
    return struct.pack("!BBQ", opcode, 127, size) + data
