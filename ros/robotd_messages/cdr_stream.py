"""CDR of ROS 2 messages (little-endian, XCDR1), written and read field by field.

Recordings are encoded here and not by rclpy, because they are written and read without ROS.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS

ENCAPSULATION = b"\x00\x01\x00\x00"  # CDR_LE; alignment counts from its end


class CdrWriter:
    """Serializer of one message: fields are added in the order of its definition."""

    def __init__(self) -> None:
        self._data = bytearray(ENCAPSULATION)

    def payload(self) -> bytes:
        """The message so far, with its encapsulation header."""
        return bytes(self._data)

    def number(self, code: str, value: float) -> int:
        """Add a number of ``struct`` format ``code``; return its offset in the payload."""
        offset = self._align(struct.calcsize(code))
        self._data += struct.pack(f"<{code}", value)
        return offset

    def time(self, time_ns: int) -> int:
        """Add a ``builtin_interfaces/Time`` or ``Duration``; return its offset."""
        seconds, nanoseconds = divmod(time_ns, NANOSECONDS)
        offset = self.number("i", seconds)
        self.number("I", nanoseconds)
        return offset

    def header(self, time_ns: int) -> int:
        """Add a ``std_msgs/Header`` without a frame; return the offset of its time."""
        offset = self.time(time_ns)
        self.string("")
        return offset

    def string(self, text: str) -> None:
        # A name of a file may have bytes that are not text: Python keeps each as half a character.
        data = text.encode(errors="backslashreplace") + b"\0"
        self.number("I", len(data))
        self._data += data

    def strings(self, texts: Sequence[str]) -> None:
        self.number("I", len(texts))
        for text in texts:
            self.string(text)

    def floats(self, values: Sequence[float] | FloatArray) -> int:
        """Add a sequence of float64; return the offset of the first value."""
        self.number("I", len(values))
        return self.array(np.asarray(values, "<f8"))

    def array(self, values: NDArray[Any]) -> int:
        """Add little-endian numbers of one type; return the offset of the first."""
        offset = self._align(values.itemsize) if len(values) else len(self._data)
        self._data += values.tobytes()
        return offset

    def octets(self, data: bytes) -> None:
        """Add a sequence of uint8."""
        self.number("I", len(data))
        self._data += data

    def _align(self, size: int) -> int:
        self._data += bytes(-(len(self._data) - len(ENCAPSULATION)) % size)
        return len(self._data)


class CdrReader:
    """Reader of one message: fields are taken in the order of its definition.

    Raises ValueError for data that ends early or is not little-endian CDR.
    """

    def __init__(self, data: bytes) -> None:
        if data[:2] != ENCAPSULATION[:2]:
            raise ValueError(f"encapsulation {data[:4].hex()} is not little-endian CDR")
        self._data = data
        self._at = len(ENCAPSULATION)

    def number(self, code: str) -> int | float:
        size = struct.calcsize(code)
        data = self._take(size, size)
        value: int | float = struct.unpack(f"<{code}", data)[0]
        return value

    def time_ns(self) -> int:
        seconds = int(self.number("i"))
        return seconds * NANOSECONDS + int(self.number("I"))

    def header_ns(self) -> int:
        """Take a ``std_msgs/Header``; return its time."""
        time_ns = self.time_ns()
        self.string()
        return time_ns

    def string(self) -> str:
        return self._take(self.count(), 1)[:-1].decode(errors="replace")

    def strings(self) -> list[str]:
        return [self.string() for _ in range(self.count())]

    def floats(self) -> FloatArray:
        count = self.count()
        return np.frombuffer(self._take(8 * count, 8 if count else 1), "<f8")

    def octets(self) -> bytes:
        return self._take(self.count(), 1)

    def count(self) -> int:
        """Take the length of a sequence."""
        count = int(self.number("I"))
        if count > len(self._data):
            raise ValueError(f"sequence of {count} items in {len(self._data)} bytes")
        return count

    def _take(self, size: int, alignment: int) -> bytes:
        begin = self._at + -(self._at - len(ENCAPSULATION)) % alignment
        if begin + size > len(self._data):
            raise ValueError(f"{size} bytes at {begin} exceed a message of {len(self._data)}")
        self._at = begin + size
        return self._data[begin : self._at]
