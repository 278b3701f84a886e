"""Preallocated ring of control-loop frames in shared memory: one copy for each period."""

from __future__ import annotations

import mmap
import os
import weakref
from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robotd.arrays import FloatArray
from robotd.device.process_image import image_type

MEMORY_BYTES = 16 * 2**20  # of the frames; events and samples take up to 6 MiB
COUNT_BYTES = 64  # before the first frame: number of frames written, int64
MAX_REASONS = 100  # the tap reads them ten times a second
PIECE_FRAMES = 64  # copied at once by a reader, which holds the interpreter: 10 us

HEADER = (
    "start_ns",  # wake-up of the control loop, monotonic time of the robot's clock
    "stamp_ns",  # nominal time of the last read, see ProcessImage.stamp_ns
    "fresh_ns",  # ProcessImage.fresh_ns
    "late_ns",  # wake-up after the deadline
    "execution_ns",  # work of the period
    "missed",  # deadlines missed since the start
    "due_ns",  # time at which the last setpoint that was sent is due; 0: no setpoint yet
    "ready",  # 1: the device takes commands
    "closed_ppm",  # Gripper.closed in millionths; 0 without a gripper
)

Frames = NDArray[Any]
"""Structured array of shape (n,) with the fields of ``frame_type``."""


class Newest(NamedTuple):
    """Newest frame, as a page shows it.

    Attributes:
        cursor: after it.
        start_ns: as in ``HEADER``.
        late_ns: largest one since the cursor of the call.
        values: block of ``ProcessImage.values``, float64, little-endian.
    """

    cursor: int
    start_ns: int
    late_ns: int
    values: bytes


def frame_type(axes: int) -> np.dtype[Any]:
    """Return the structured type of a frame: ``HEADER``, then the blocks of the image."""
    image = image_type(axes)
    blocks = [(name, image[name]) for name in image.names or ()]
    return np.dtype([*((name, "<i8") for name in HEADER), *blocks])


def measured_joints(
    frames: Frames, fingers: Mapping[str, tuple[float, float]]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return measured position, velocity and effort of axes and fingers, as ``/joint_states`` has.

    Args:
        frames: shape (n,).
        fingers: as ``Gripper.finger_ends``; empty without a gripper.

    Returns three arrays (n, axes + fingers); of the fingers velocity is 0 and effort NaN: not
    measured.
    """
    opened, closed = np.array([*fingers.values()], np.float64).reshape(-1, 2).T
    positions = opened + (closed - opened) * (frames["closed_ppm"][:, np.newaxis] * 1e-6)
    unknown = np.full_like(positions, np.nan)
    position, velocity, effort = (frames["values"][:, row] for row in (2, 3, 4))
    return (
        np.hstack((position, positions)),
        np.hstack((velocity, 0.0 * positions)),
        np.hstack((effort, unknown)),
    )


class FrameMemory:
    """Frames in shared memory, for readers in this and in other processes.

    ``fd``: file descriptor of the memory; stays with the caller.

    Attributes:
        memory: number of frames written, then the frames from ``COUNT_BYTES`` on.
        count: that number, in one item.
    """

    def __init__(self, fd: int, axes: int, capacity: int) -> None:
        self.fd, self.axes, self.capacity = fd, axes, capacity
        self.type = frame_type(axes)
        size = COUNT_BYTES + capacity * self.type.itemsize
        self.memory = memoryview(mmap.mmap(fd, size))
        self.count = self.memory[:8].cast("q")
        self._frames: Frames = np.frombuffer(self.memory, self.type, capacity, COUNT_BYTES)
        self._values: FloatArray = self._frames["values"]
        # One column of the header each: reading items of an array takes ten times as long.
        numbers, columns = self.memory[COUNT_BYTES:].cast("q"), self.type.itemsize // 8
        self._starts_ns = numbers[HEADER.index("start_ns") :: columns]
        self._late_ns = numbers[HEADER.index("late_ns") :: columns]

    @property
    def written(self) -> int:
        """Number of frames since the start: the cursor after the newest."""
        return self.count[0]

    @property
    def nbytes(self) -> int:
        """Size of the memory."""
        return self.memory.nbytes

    @property
    def oldest_ns(self) -> int:
        """``start_ns`` of the oldest frame; 0 before the first."""
        frames, _, _ = self.since(0, 1)
        return int(frames["start_ns"][0]) if len(frames) else 0

    def newest(self, cursor: int) -> Newest | None:
        """Return the newest frame; None without one after ``cursor``. Any thread.

        Copies its values only: a tenth of the time of ``since`` for the frames of a page.
        """
        end = self.written
        if end == cursor:
            return None
        first = max(cursor, end - self.capacity + 1)
        late_ns = max(self._late_ns[number % self.capacity] for number in range(first, end))
        last = (end - 1) % self.capacity
        values = self._values[last].tobytes()
        return Newest(end, self._starts_ns[last], late_ns, values)

    def since(self, cursor: int, limit: int | None = None) -> tuple[Frames, int, int]:
        """Return the frames after ``cursor``, the next cursor, and the number of lost frames.

        Copies in pieces, so that the control loop does not wait for the interpreter. Any thread.

        Args:
            cursor: from the last call; 0 at first.
            limit: number of frames to return at most; None: all.
        """
        last = self.written
        first = max(cursor, last - self.capacity + 1)
        if limit is not None:
            last = min(last, first + limit)
        copied = np.empty(max(0, last - first), self.type)
        for begin in range(first, last, PIECE_FRAMES):
            indices = np.arange(begin, min(begin + PIECE_FRAMES, last)) % self.capacity
            copied[begin - first : begin - first + len(indices)] = self._frames[indices]
        # Frames that were overwritten while they were copied.
        torn = max(0, self.written - self.capacity + 1 - first)
        return copied[torn:], last, first - cursor + min(torn, len(copied))


class FrameRing(FrameMemory):
    """Last ``seconds`` of frames, fewer where they exceed the memory limit.

    Any thread may read; ``period_writer`` fills it.

    Attributes:
        reasons: latest changes of ``ProcessImage.reason``: ``start_ns`` of the first frame with
            these texts, and the texts.
    """

    def __init__(
        self,
        axes: int,
        rate_hz: float,
        seconds: float,
        memory_bytes: int = MEMORY_BYTES,
    ) -> None:
        size = frame_type(axes).itemsize
        capacity = max(2, min(round(rate_hz * seconds), (memory_bytes - COUNT_BYTES) // size))
        fd = os.memfd_create("robotd-frames")
        os.ftruncate(fd, COUNT_BYTES + capacity * size)
        super().__init__(fd, axes, capacity)
        self.reasons: deque[tuple[int, list[str]]] = deque(maxlen=MAX_REASONS)
        weakref.finalize(self, os.close, fd)
        # Written once, because the first access to a page costs the control loop 1 us or more.
        self._frames.view(np.uint8)[:] = 1
