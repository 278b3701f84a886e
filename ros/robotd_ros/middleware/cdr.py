"""Publishing of messages that are serialized once and then patched in place.

Works around: building, filling and serializing a message object costs 12.5 us per call (JointState
of 8 joints, x86_64, CPython 3.11, no subscriber). A message whose strings and array lengths are
constant needs none of it: its CDR bytes stay the same but for some numbers.
Measured: writing the numbers in place and publishing the bytes costs 2 us, of which
``Publisher.publish(bytes)`` is 1.2. ``rcl_publish_serialized_message`` called directly would save
0.6 us more, and with it the checks against a destroyed publisher; the public function is preferred.
In a loop that comes out of a sleep it costs 20 to 30 us, with and without a subscriber, so messages
without subscribers are neither filled nor published.
Upstream: https://github.com/ros2/rclpy/issues/836 (cost of message conversion; open).
Shown by: tests/ros/test_cdr.py, tools/bench/middleware.py.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from rclpy._rclpy_pybind11 import RCLError
from rclpy.event_handler import PublisherEventCallbacks, UnsupportedEventTypeError
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message, serialize_message

from robotd.clock import NANOSECONDS
from robotd.log import get_logger
from robotd_ros.middleware.message_fields import MessageField, time_paths

log = get_logger("ros")

# Length of the encapsulation header; CDR aligns everything relative to its end.
_HEADER_BYTES = 4
_ALIGNMENT_BYTES = 8
# Each round leaves a wrong place for a one-byte field a chance of 1 in 2, so 2^-24 in the end. Two
# or three are usual; 24 for each message would add 15 ms to the start of a robot.
_MAX_ROUNDS = 24


class LayoutError(ValueError):
    """The serialized form of a message cannot be patched; ``HotPublisher`` then does without."""


class HotMessage(Protocol):
    """Message of constant shape whose numbers change; owned by the control loop's thread."""

    def view(self, path: str) -> NDArray[Any]:
        """The numbers of ``path``, shape (count,); what is written here is published."""

    def stamp(self, time_ns: int) -> None:
        """Set every ``builtin_interfaces/Time`` of the message; ns since the epoch."""

    def payload(self) -> Any:
        """Argument for ``Publisher.publish``, valid until the next change of the message."""


class PatchedMessage:
    """The CDR bytes of ``template``, with a writable numpy view for each path of ``views``.

    The template's strings and array lengths are constant from now on. Where a field lies is found
    by serializing the template with random numbers in it and looking for them, so it needs no
    knowledge of the type or of the encoding; a message read back from the patched bytes must
    then equal the template with the same numbers. The template itself is left unchanged.

    Raises:
        ValueError: a path does not exist or does not mean numbers of one type.
        LayoutError: a field was not found in the bytes, or reading back gave something else.
    """

    def __init__(self, template: Any, views: Iterable[str]) -> None:
        times = list(time_paths(template))
        paths = [*views, *(f"{path}.{part}" for path in times for part in ("sec", "nanosec"))]
        fields = [MessageField(template, path) for path in paths]
        originals = [field.get() for field in fields]
        try:
            offsets = _find(template, fields)
            self._buffer = _aligned_copy(serialize_message(template))
            self._views = {
                field.path: np.ndarray(field.count, field.dtype, self._buffer, offset)
                for field, offset in zip(fields, offsets, strict=True)
            }
            self._verify(template, fields)
        finally:
            for field, original in zip(fields, originals, strict=True):
                field.set(original)
        for field, original in zip(fields, originals, strict=True):
            self._views[field.path][:] = original
        self._times = [
            (self._views[f"{t}.sec"].data, self._views[f"{t}.nanosec"].data) for t in times
        ]

    def view(self, path: str) -> NDArray[Any]:
        return self._views[path]

    def stamp(self, time_ns: int) -> None:
        seconds, nanoseconds = divmod(time_ns, NANOSECONDS)
        for sec, nanosec in self._times:
            sec[0] = seconds
            nanosec[0] = nanoseconds

    def payload(self) -> bytes:
        return self._buffer.tobytes()

    def _verify(self, template: Any, fields: list[MessageField]) -> None:
        """Patch other numbers than the ones in the bytes, read back, compare with the template."""
        _randomize(random.Random(_MAX_ROUNDS), fields)  # noqa: S311 - no secret
        for field in fields:
            self._views[field.path][:] = field.get()
        # repr, because a NaN in another field would differ from itself.
        if repr(deserialize_message(self.payload(), type(template))) != repr(template):
            raise LayoutError(f"{type(template).__name__}: patched bytes read back differently")


class PlainMessage:
    """``HotMessage`` over an ordinary message object, filled field by field.

    Raises:
        ValueError: a path does not exist or does not mean numbers of one type.
    """

    def __init__(self, template: Any, views: Iterable[str]) -> None:
        self._message = template
        self._fields = [MessageField(template, path) for path in views]
        self._values = {field.path: field.get() for field in self._fields}
        self._times = [
            (MessageField(template, f"{path}.sec"), MessageField(template, f"{path}.nanosec"))
            for path in time_paths(template)
        ]

    def view(self, path: str) -> NDArray[Any]:
        return self._values[path]

    def stamp(self, time_ns: int) -> None:
        parts = np.array(divmod(time_ns, NANOSECONDS))
        for sec, nanosec in self._times:
            sec.set(parts[:1])
            nanosec.set(parts[1:])

    def payload(self) -> Any:
        for field in self._fields:
            field.set(self._values[field.path])
        return self._message


class Link:
    """Copies the numbers of ``source`` to the beginning of ``target`` when called.

    Both are contiguous, not empty, and of one type. Bytes of memory views: in a loop that comes
    out of a sleep a third of what an assignment of NumPy costs.
    """

    def __init__(self, target: NDArray[Any], source: NDArray[Any]) -> None:
        self._source = source.data.cast("B")
        self._target = target.data.cast("B")[: len(self._source)]

    def __call__(self) -> None:
        self._target[:] = self._source


class HotPublisher:
    """Publisher with one message, made in any thread, then owned by the control loop.

    Falls back to ordinary messages, at about ten times the cost, where the serialized form
    cannot be patched; the numbers that are published are the same.

    Attributes:
        topic: its resolved name.
        view: numbers of a path of ``views``, shape (count,): keep it, write into it, publish.
        stamp: sets every time stamp in the message; ns since the epoch.
        has_readers: there are subscribers; False: the message needs neither values nor ``publish``.
            Set by the node's executor when a subscription comes or goes.

    Args:
        node: owner of the publisher, which is made here.
        topic: its name.
        depth: of its queue.
        template: the message with its constant strings and array lengths; not shared.
        views: paths that ``view`` is going to be asked for.
        sources: arrays by path, copied to the beginning of its numbers by ``publish``.

    Raises:
        ValueError: a path does not exist or does not mean numbers of one type.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        depth: int,
        template: Any,
        views: Iterable[str] = (),
        sources: Mapping[str, NDArray[Any]] = MappingProxyType({}),
    ) -> None:
        paths = [*views, *sources]
        self.has_readers = False
        self._publisher = self._create(node, topic, depth, type(template))
        self.topic = str(self._publisher.topic_name)
        self._lost = False
        self._message: HotMessage
        try:
            self._message = PatchedMessage(template, paths)
        except LayoutError as error:
            log.warning("publishing ordinary messages", topic=self.topic, reason=str(error))
            self._message = PlainMessage(template, paths)
        self.view, self.stamp = self._message.view, self._message.stamp
        self._links = [Link(self.view(path), array) for path, array in sources.items()]

    def _create(self, node: Node, topic: str, depth: int, message_type: type) -> Publisher:
        """Return the publisher; where the middleware has no such event, readers are assumed."""
        callbacks = PublisherEventCallbacks(matched=self._on_matched)
        try:
            return node.create_publisher(message_type, topic, depth, event_callbacks=callbacks)
        except UnsupportedEventTypeError:
            self.has_readers = True
            return node.create_publisher(message_type, topic, depth)

    def _on_matched(self, event: Any) -> None:
        self.has_readers = event.current_count > 0

    def publish(self) -> None:
        """Send the message. Never raises for a destroyed publisher."""
        for copy in self._links:
            copy()
        try:
            self._publisher.publish(self._message.payload())
        except (InvalidHandle, RCLError) as error:
            # The control loop outlives ROS by a period or two at shut-down: one warning.
            if not self._lost:
                self._lost = True
                log.warning("publishing failed", topic=self.topic, reason=str(error))
        else:
            self._lost = False


def _aligned_copy(data: bytes) -> NDArray[np.uint8]:
    """A copy that starts so that what CDR aligns is aligned in memory too."""
    room = np.empty(len(data) + 2 * _ALIGNMENT_BYTES, np.uint8)
    start = -(room.ctypes.data + _HEADER_BYTES) % _ALIGNMENT_BYTES
    copy = room[start : start + len(data)]
    copy[:] = np.frombuffer(data, np.uint8)
    return copy


def _find(template: Any, fields: list[MessageField]) -> list[int]:
    """Offset of each field in the serialized template: the one place that follows every change."""
    generator = random.Random(0)  # noqa: S311 - no secret
    candidates: dict[str, set[int]] = {}
    ambiguous = [field for field in fields if field.count]
    for _ in range(_MAX_ROUNDS):
        _randomize(generator, fields)
        data = serialize_message(template)
        for field in ambiguous:
            found = _occurrences(data, field.get().tobytes())
            candidates[field.path] = candidates.get(field.path, found) & found
        ambiguous = [field for field in ambiguous if len(candidates[field.path]) != 1]
        if not ambiguous:
            break
    for field in ambiguous:
        places = len(candidates[field.path])
        what = f"{type(template).__name__}.{field.path}: found at {places} places, not at 1"
        raise LayoutError(what)
    return [min(candidates.get(field.path, {0})) for field in fields]


def _occurrences(data: bytes, pattern: bytes) -> set[int]:
    found = set()
    position = data.find(pattern, _HEADER_BYTES)
    while position >= 0:
        found.add(position)
        position = data.find(pattern, position + 1)
    return found


def _randomize(generator: random.Random, fields: list[MessageField]) -> None:
    for field in fields:
        field.set(_random_values(generator, field))


def _random_values(generator: random.Random, field: MessageField) -> NDArray[Any]:
    """Finite numbers of the field's type; ``numpy.random`` would be 30 modules more."""
    if field.dtype.kind == "f":
        numbers: list[float] = [generator.random() for _ in range(field.count)]
    elif field.dtype.kind == "b":
        numbers = [generator.getrandbits(1) for _ in range(field.count)]
    else:
        limits = np.iinfo(field.dtype)
        numbers = [generator.randint(limits.min, limits.max) for _ in range(field.count)]
    return np.array(numbers, field.dtype)
