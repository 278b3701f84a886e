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
Ends with: no version yet.
Shown by: tests/ros/test_cdr.py, tools/bench/middleware.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from rclpy.event_handler import PublisherEventCallbacks, UnsupportedEventTypeError
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import serialize_message

from robotd.clock import NANOSECONDS
from robotd.log import get_logger
from robotd_ros.middleware.message_fields import MessageEncoder, MessageField, time_paths
from robotd_ros.middleware.rcl_error import NODE_GONE

log = get_logger("ros")

# Length of the encapsulation header; CDR aligns everything relative to its end.
_HEADER_BYTES = 4
_ALIGNMENT_BYTES = 8


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

    The template's strings and array lengths are constant from now on. The template is encoded here,
    which gives the offset of each field; the middleware's bytes must be the same.

    Raises:
        ValueError: a path does not exist or does not mean numbers of one type.
        LayoutError: the middleware encodes the message in another way, or the numbers of a path do
            not lie side by side.
    """

    def __init__(self, template: Any, views: Iterable[str]) -> None:
        name, times = type(template).__name__, list(time_paths(template))
        paths = [*views, *(f"{path}.{part}" for path in times for part in ("sec", "nanosec"))]
        fields = [MessageField(template, path) for path in paths]
        data = serialize_message(template)
        try:
            encoder = MessageEncoder(template)
        except ValueError as error:
            raise LayoutError(f"{name}: {error}") from error
        if not encoder.is_in(data):
            raise LayoutError(f"{name}: the middleware encodes it in another way")
        offsets = encoder.offsets
        self._buffer = _aligned_copy(data)
        self._views = {
            field.path: np.ndarray(
                field.count, field.dtype, self._buffer, offset_of(field, offsets)
            )
            for field in fields
        }
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


class PlainMessage:
    """``HotMessage`` over an ordinary message object, filled field by field.

    Raises ValueError: a path does not exist or does not mean numbers of one type.
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

    Raises ValueError: a path does not exist or does not mean numbers of one type.
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
        except NODE_GONE as error:
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


def offset_of(field: MessageField, offsets: Mapping[str, int]) -> int:
    """Return the offset of the first number of ``field``. Raises LayoutError."""
    if field.path in offsets:
        return offsets[field.path]
    # A message stands for its numbers, which lie side by side unless it has sequences.
    parts = [at for path, at in offsets.items() if path.startswith(f"{field.path}.")]
    if parts != list(
        range(parts[0], parts[0] + field.count * field.dtype.itemsize, field.dtype.itemsize)
    ):
        raise LayoutError(f"{field.path}: its numbers do not lie side by side")
    return parts[0]
