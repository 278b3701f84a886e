"""Values of objects (SDO) as text."""

from __future__ import annotations


def object_text(data: bytes) -> str:
    """Format data as ``37 02 (0x0237, 567)``, with the text where it is printable."""
    parts = [data.hex(" ")]
    if len(data) in (1, 2, 4, 8):
        number = int.from_bytes(data, "little")
        parts.append(f"(0x{number:0{2 * len(data)}X}, {number})")
    if len(data) > 1 and data.isascii() and (text := data.decode("ascii")).isprintable():
        parts.append(repr(text))
    return " ".join(parts)
