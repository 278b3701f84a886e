"""Values of objects (SDO): their bytes, and their text."""

from __future__ import annotations

from robotd.errors import InvalidArgument


def object_text(data: bytes) -> str:
    """Format data as ``37 02 (0x0237, 567)``, with the text where it is printable."""
    if not data:
        return "(empty)"
    parts = [data.hex(" ")]
    if len(data) in (1, 2, 4, 8):
        number = int.from_bytes(data, "little")
        parts.append(f"(0x{number:0{2 * len(data)}X}, {number})")
    if len(data) > 1 and data.isascii() and (text := data.decode("ascii")).isprintable():
        parts.append(repr(text))
    return " ".join(parts)


def object_bytes(value: int, size: int) -> bytes:
    """Return ``size`` bytes of ``value``, signed or not, little-endian. Raises InvalidArgument."""
    limit = 1 << 8 * size
    if not -limit // 2 <= value < limit:
        raise InvalidArgument(f"value {value} does not fit in {size} byte{'s' * (size != 1)}")
    return (value % limit).to_bytes(size, "little")
