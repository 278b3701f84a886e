"""CAN line in simulated time behind python-can's interface, with drives and faults of the line.

``can.Bus(interface="witness", channel=NAME)`` opens an adapter on the line of that name. Frames
that the adapter takes are with the drives at once, and what the drives answer is with the receiver
before simulated time goes on, so that a run is the same each time. ``interface="keeping"`` opens
one that cannot discard frames which wait.
"""

from __future__ import annotations

import heapq
import itertools
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import can
import can.interfaces
import can.util
from tests.witness.bench import STEP_S

PATIENCE_S = 20.0  # real time for the receiver to take what has arrived
LATENCY_S = 0.0003  # of an answer on the line
SDO_RESPONSE = 0x580
QUEUE_FRAMES = 1000  # of the interface: its txqueuelen

LINES: dict[str, Line] = {}


class Node(Protocol):
    """Member of the line."""

    node_id: int

    def receive(self, message: can.Message, now: float) -> None: ...

    def tick(self, now: float) -> None: ...

    def restart(self) -> None: ...


@dataclass
class Fault:
    """Faults of the way between the master and one node; times are the simulated ones they end at.

    Attributes:
        deaf_s: the node gets no frame until then.
        mute_s: its frames do not arrive until then.
        late_s, delay_s: frames to it come ``delay_s`` late until ``late_s``.
    """

    deaf_s: float = 0.0
    mute_s: float = 0.0
    late_s: float = 0.0
    delay_s: float = 0.0
    last_s: float = 0.0  # when the last late frame arrives: none overtakes it


class Line:
    """Nodes, the way to them, and the adapter of the master. One thread but for the receiver.

    Args:
        now_s: simulated time.
    """

    def __init__(self, name: str, now_s: Callable[[], float]) -> None:
        self.nodes: dict[int, Node] = {}
        self.faults: dict[int, Fault] = {}
        self.blocked_s = 0.0  # the adapter sends nothing until then, and queues
        self.queue_frames = QUEUE_FRAMES
        self.adapter: Adapter | None = None
        self.waited: list[can.Message] = []  # frames that were carried late, after a block
        self._now_s, self._last_s = now_s, now_s()
        self._queue: deque[can.Message] = deque()
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        LINES[name] = self

    def add(self, make: Callable[[Callable[[can.Message], None]], Node]) -> None:
        """Add the node that ``make`` makes of the function by which it sends."""
        made: list[Node] = []
        node = make(lambda message: self._answer(made[0].node_id, message))
        made.append(node)
        self.nodes[node.node_id], self.faults[node.node_id] = node, Fault()
        node.tick(self._last_s)

    def cut(self, seconds: float, nodes: Sequence[int] = (), *, deaf: bool, mute: bool) -> None:
        """Cut the way to (``deaf``) and from (``mute``) nodes, all without ``nodes``."""
        until_s = self._now_s() + seconds
        for number in nodes or self.nodes:
            fault = self.faults[number]
            fault.deaf_s = until_s if deaf else fault.deaf_s
            fault.mute_s = until_s if mute else fault.mute_s

    def delay(self, seconds: float, delay_s: float, nodes: Sequence[int] = ()) -> None:
        for number in nodes or self.nodes:
            self.faults[number].late_s = self._now_s() + seconds
            self.faults[number].delay_s = delay_s

    def block(self, seconds: float) -> None:
        """Let the adapter send nothing for a time; it queues what it is given."""
        self.blocked_s = self._now_s() + seconds

    def discard(self) -> None:
        """Forget the frames that wait in the adapter."""
        self._queue.clear()

    def heal(self) -> None:
        """End all faults."""
        self.blocked_s = 0.0
        for fault in self.faults.values():
            fault.deaf_s = fault.mute_s = fault.late_s = 0.0

    def send(self, message: can.Message) -> None:
        """Send a frame of the master. Raises can.CanOperationError: the queue is full."""
        self.advance()
        now = self._now_s()
        message = can.Message(  # the sender may use its own again
            timestamp=now,
            arbitration_id=message.arbitration_id,
            is_extended_id=message.is_extended_id,
            is_remote_frame=message.is_remote_frame,
            data=bytes(message.data),
        )
        if now < self.blocked_s:
            if len(self._queue) >= self.queue_frames:
                raise can.CanOperationError("No buffer space available", 105)
            self._queue.append(message)
        else:
            self._carry(message, now)

    def advance(self) -> None:
        """Let the nodes live up to the present."""
        end_s = self._now_s()
        while self._last_s < end_s - 1e-9:
            self._last_s = min(end_s, self._last_s + STEP_S)
            while self._due and self._due[0][0] <= self._last_s + 1e-9:
                heapq.heappop(self._due)[2]()
            if self._queue and self._last_s >= self.blocked_s:
                self.waited += self._queue
                while self._queue:
                    self._carry(self._queue.popleft(), self._last_s)
            for node in self.nodes.values():
                node.tick(self._last_s)

    def _carry(self, message: can.Message, now: float) -> None:
        for number, node in self.nodes.items():
            fault = self.faults[number]
            if now < fault.deaf_s:
                continue
            due_s = now + (fault.delay_s if now < fault.late_s else 0.0)
            if (due_s := max(due_s, fault.last_s)) > now:
                fault.last_s = due_s
                self._at(due_s, partial(self._receive_late, node, message))
            else:
                node.receive(message, now)

    def _answer(self, number: int, message: can.Message) -> None:
        now = self._now_s()
        if self.adapter is None or now < self.faults[number].mute_s:
            return
        if message.arbitration_id - number == SDO_RESPONSE:
            self.adapter.deliver(message)  # the master waits for it in real time
        else:
            self._at(now + LATENCY_S, partial(self.adapter.deliver, message))

    def _receive_late(self, node: Node, message: can.Message) -> None:
        node.receive(message, self._last_s)

    def _at(self, time_s: float, action: Callable[[], None]) -> None:
        heapq.heappush(self._due, (time_s, next(self._order), action))


class Adapter(can.BusABC):
    """The master's adapter on a line."""

    def __init__(self, channel: str, **_: Any) -> None:
        self.line = LINES[channel]
        self.channel_info = f"witness line {channel}"
        self._received: deque[can.Message] = deque()
        self._changed = threading.Condition()
        self._idle = False
        self._receiver: int | None = None
        super().__init__(channel)
        self.line.adapter = self

    def deliver(self, message: can.Message) -> None:
        with self._changed:
            self._received.append(message)
            self._changed.notify_all()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.line.adapter is not self:
            raise can.CanOperationError("the adapter is closed")
        try:
            self.line.send(msg)
        finally:
            self.settle()

    def flush_tx_buffer(self) -> None:
        """Discard what waits to be sent."""
        self.line.discard()

    def settle(self) -> None:
        """Wait until the receiver has taken all that has arrived."""
        if threading.get_ident() == self._receiver or self._receiver is None:
            return
        with self._changed:
            self._changed.wait_for(
                lambda: self._receiver is None or (self._idle and not self._received), PATIENCE_S
            )

    def recv(self, timeout: float | None = None) -> can.Message | None:
        self._receiver = threading.get_ident()
        with self._changed:
            self._idle = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: bool(self._received), timeout)
            if not self._received:
                return None
            self._idle = False
            return self._received.popleft()

    def shutdown(self) -> None:
        super().shutdown()
        if self.line.adapter is self:
            self.line.adapter = None
        with self._changed:
            self._receiver = None
            self._changed.notify_all()


class KeepingAdapter(Adapter):
    """An adapter that cannot discard what waits to be sent."""

    flush_tx_buffer = can.BusABC.flush_tx_buffer  # raises NotImplementedError


# As installed interfaces would be by their entry points.
can.interfaces.BACKENDS["witness"] = ("tests.witness.can_line", "Adapter")
can.interfaces.BACKENDS["keeping"] = ("tests.witness.can_line", "KeepingAdapter")
can.util.VALID_INTERFACES |= {"witness", "keeping"}  # type: ignore[misc]
