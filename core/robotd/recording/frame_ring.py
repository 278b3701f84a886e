"""Preallocated ring of control-loop frames: one copy of all values in each period."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotd.device.process_image import ProcessImage, image_type

MEMORY_BYTES = 20 * 2**20  # of the frames; with the events (4 MiB) at most 24 MiB
PIECE_FRAMES = 64  # copied at once by a reader, which holds the interpreter: 10 us

HEADER = (
    "start_ns",  # wake-up of the control loop, monotonic time of the robot's clock
    "stamp_ns",  # nominal time of the last read, see ProcessImage.stamp_ns
    "fresh_ns",  # ProcessImage.fresh_ns
    "late_ns",  # wake-up after the deadline
    "execution_ns",  # work of the period
    "missed",  # deadlines missed since the start
    "due_ns",  # time at which the last setpoint that was sent is due; 0: none was sent
    "ready",  # 1: the device takes commands
)
_HEADER_BYTES = 8 * len(HEADER)
_PACK = struct.Struct(f"<{len(HEADER)}q").pack_into

Frames = NDArray[Any]
"""Structured array of shape (n,) with the fields of ``frame_type``."""


def frame_type(axes: int) -> np.dtype[Any]:
    """Return the structured type of a frame: ``HEADER``, then the blocks of the image."""
    image = image_type(axes)
    blocks = [(name, image[name]) for name in image.names or ()]
    return np.dtype([*((name, "<i8") for name in HEADER), *blocks])


class FrameRing:
    """Last ``seconds`` of frames, fewer where they exceed the memory limit.

    ``write`` belongs to the control loop; any thread may read.

    Args:
        image: process image that is copied.
        rate_hz: of the control loop.
        seconds: time to hold.
        memory_bytes: limit of the frames.

    Attributes:
        capacity: number of frames.
        written: frames written since the start: the cursor behind the newest.
    """

    def __init__(
        self,
        image: ProcessImage,
        rate_hz: float,
        seconds: float,
        memory_bytes: int = MEMORY_BYTES,
    ) -> None:
        self.type = frame_type(image.axes)
        size = self.type.itemsize
        self.capacity = max(2, min(round(rate_hz * seconds), memory_bytes // size))
        self.written = 0
        self._size = size
        # Written once, because the first access to a page costs the control loop 1 us or more.
        self._frames: Frames = np.zeros(self.capacity, self.type)
        self._frames.view(np.uint8)[:] = 1
        self._bytes = self._frames.view(np.uint8).data
        self._image = image.memory

    @property
    def nbytes(self) -> int:
        """Memory of the frames."""
        return int(self._frames.nbytes)

    def write(self, *header: int) -> None:
        """Copy the image behind ``header``, in the order of ``HEADER``. Control-loop thread."""
        start = self.written % self.capacity * self._size
        _PACK(self._bytes, start, *header)
        self._bytes[start + _HEADER_BYTES : start + self._size] = self._image
        self.written += 1

    def since(self, cursor: int) -> tuple[Frames, int, int]:
        """Return the frames after ``cursor``, the next cursor, and the number of lost frames.

        Copies in pieces, so that the control loop does not wait for the interpreter.
        """
        last = self.written
        first = max(cursor, last - self.capacity + 1)
        copied = np.empty(max(0, last - first), self.type)
        for begin in range(first, last, PIECE_FRAMES):
            indices = np.arange(begin, min(begin + PIECE_FRAMES, last)) % self.capacity
            copied[begin - first : begin - first + len(indices)] = self._frames[indices]
        # Frames that were overwritten while they were copied.
        torn = max(0, self.written - self.capacity + 1 - first)
        return copied[torn:], last, first - cursor + min(torn, len(copied))
