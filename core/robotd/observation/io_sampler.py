"""Samples of the I/O image, of every period where the backend shows it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress

from robotd.device.io import Io
from robotd.errors import RobotdError

MAX_IO_BYTES = 256  # recorded of the inputs and of the outputs
MAX_WAITING = 1024  # changes between two calls of ``changes``
QUEUE_BYTES = MAX_WAITING * (MAX_IO_BYTES + 128)

# Names of the samples, which are topics of a recording.
INPUTS, OUTPUTS, FIELDBUS = "/robotd/inputs", "/robotd/outputs", "/robotd/fieldbus"
OBJECTS = "/robotd/objects"

NamedValues = Mapping[str, Mapping[str, float]]
Change = tuple[int, str, bytes]
"""Monotonic time, ``INPUTS`` or ``OUTPUTS``, and the bytes of the image."""
Sample = Change | tuple[int, str, NamedValues]
"""A change of the I/O, or values by name: the fieldbus (``FIELDBUS``) or poses (``OBJECTS``)."""


class IoSampler:
    """Finds changes of inputs and outputs.

    ``now_ns``: monotonic time of the robot's clock.

    Attributes:
        live: functions that read the inputs and the outputs of a live image; None without one.
        add: takes a change of a live image. Control-loop thread.
    """

    def __init__(self, io: Io, now_ns: Callable[[], int]) -> None:
        self._io, self._now_ns = io, now_ns
        self._seen: dict[str, bytes] = {}
        self._changes: deque[Change] = deque(maxlen=MAX_WAITING)
        self.add = self._changes.append
        live = io.live
        self.live = tuple(image[:MAX_IO_BYTES].tobytes for image in live) if live else None

    def changes(self) -> Iterator[Change]:
        """Yield the changes since the last call. Thread of the tap; the device communicates."""
        if self.live is None:
            self._sample()
        while self._changes:
            yield self._changes.popleft()

    def _sample(self) -> None:
        time_ns = self._now_ns()
        for topic, data in self._images():
            if data != self._seen.get(topic):
                self._seen[topic] = data
                self._changes.append((time_ns, topic, data))

    def _images(self) -> Iterator[tuple[str, bytes]]:
        sizes = [min(size, MAX_IO_BYTES) for size in self._io.sizes]
        with suppress(RobotdError):  # a device that was lost just now
            if sizes[0]:
                yield INPUTS, self._io.input_bytes(0, sizes[0])
            if sizes[1]:
                yield OUTPUTS, self._io.output_bytes(0, sizes[1])
