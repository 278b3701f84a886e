"""Subscriptions of topics that move something: each command is judged by when it was sent.

A reliable publisher sends again what was lost while a link was cut. Such a command must not move
anything, and a dead-man time counts from the sending of a command, not from its arrival.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from robotd.clock import NANOSECONDS, Clock, MonotonicClock
from robotd.control.loop.rearming import Reception
from robotd.errors import InvalidArgument, RobotdError
from robotd.events import EventKind
from robotd.log import get_logger, shortened
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes.trajectory_conversions import stamp_ns
from robotd_ros.services import HANDLER_SHARE, WHOLE, Targets, add_informed_subscription

log = get_logger("commands")

LATE = "late"  # outcome in the counts of events, with which metrics label it

# As a command is sent and judged by two clocks.
SAME_TIME = "are the clocks of both computers in step (chrony, ptp)?"
SAME_SOURCE = "this node takes the time from /clock (use_sim_time): does the client, too?"
MAX_KNOWN = 256  # axes that are remembered
MAX_AXES = 128  # of one message
MAX_KINDS = 16  # of texts, which may contain names that a client makes up
PAUSE_S = 2.0  # without a rejection; the next one belongs to another attempt

_NUMBERS = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")


def header_stamp_ns(message: Any) -> int:
    """Return ``header.stamp`` of ``message``; 0, "now", of one without a header."""
    header = getattr(message, "header", None)
    return 0 if header is None else stamp_ns(header.stamp)


def add_command_subscription(
    node: Node,
    host: RosHost,
    robot: Robot,
    message_type: Any,
    topic: str,
    handler: Callable[[Any, int], object],
    qos: QoSProfile | int,
    timeout_s: float | Callable[[Any], float],
    sent_at_ns: Callable[[Any], int] = header_stamp_ns,
    share: float = HANDLER_SHARE,
    targets: Callable[[bytes], Targets] = lambda data: WHOLE,
) -> Subscription:
    """Create a subscription of commands, ``handler(message, sent_ns)``; see ``CommandTimes``.

    ``sent_ns`` is on the clock of the control loop. Commands that are too old, or ahead, are
    dropped and counted; the first one is logged, and their number when one is in time again.

    Args:
        node, host, message_type, topic, qos: see ``add_subscription``.
        robot: is commanded.
        handler: executor thread; may raise.
        timeout_s: age at which a command is dropped, or a function of the message.
        sent_at_ns: time in the message, by the node's clock; 0: it says none.
        share: highest of the executor's time.
        targets: see ``add_informed_subscription``.
    """
    times, rejections = CommandTimes(node, robot.clock), RejectionLog(host)
    reception = Reception(robot.rearming)
    shown = node.resolve_topic_name(topic) if topic.startswith("~") else topic
    dropped = 0

    def on_message(message: Any, info: Mapping[str, Any]) -> None:
        with reception.message(info["publication_sequence_number"]):
            take(message, info["source_timestamp"])

    def take(message: Any, source_ns: int) -> None:
        nonlocal dropped
        limit_s = timeout_s(message) if callable(timeout_s) else timeout_s
        try:
            sent_ns = times.sent_ns(source_ns, sent_at_ns(message), limit_s)
        except InvalidArgument as error:
            dropped += 1
            reception.drop()
            robot.axes.events.count(EventKind.COMMAND, LATE)
            rejections.rejected(shown, (), str(error))
            return
        if dropped:
            log.info("commands are in time again", topic=shown, dropped=dropped)
            dropped = 0
        rejections.accepted(shown, ())
        handler(message, sent_ns)

    return add_informed_subscription(
        node, host, message_type, topic, on_message, qos, share, targets
    )


class CommandTimes:
    """Finds when commands were sent: by the middleware, and by the time in the message.

    Both are checked: with simulated time, ``/clock`` may have been held while a link was cut.

    Args:
        node: its clock is the one of times in messages.
        clock: of the control loop.
    """

    def __init__(self, node: Node, clock: Clock) -> None:
        self._ros_clock, self._clock = node.get_clock(), clock
        self._is_real = isinstance(clock, MonotonicClock)

    def sent_ns(self, source_ns: int, stamp_ns: int, timeout_s: float) -> int:
        """Return the time of a command's sending on the clock of the control loop.

        A command from a clock that is ahead counts as sent now, if by no more than ``timeout_s``.

        Args:
            source_ns: system time at which it was published; 0: unknown.
            stamp_ns: time in the message, by the node's clock; 0: none.
            timeout_s: highest age.

        Raises InvalidArgument: it is older, or further ahead.
        """
        now_ns, age_ns = self._clock.now_ns(), 0
        follows_topic = self._ros_clock.ros_time_is_active
        if source_ns:
            source_age_ns = time.time_ns() - source_ns
            _check(source_age_ns, timeout_s, "this computer's clock", SAME_TIME)
            if self._is_real:
                age_ns = source_age_ns
        if stamp_ns:
            stamp_age_ns = self._ros_clock.now().nanoseconds - stamp_ns
            whose = "the time of /clock" if follows_topic else "this computer's clock"
            advice = SAME_SOURCE if follows_topic else SAME_TIME
            _check(stamp_age_ns, timeout_s, whose, advice)
            if self._is_real != follows_topic:  # seconds of the control loop's clock
                age_ns = max(age_ns, stamp_age_ns)
        return now_ns - max(age_ns, 0)


def _check(age_ns: int, timeout_s: float, whose: str, advice: str) -> None:
    age_s = age_ns / NANOSECONDS
    if age_s > timeout_s:
        raise InvalidArgument(
            f"the command is {age_s:.3g} s older than {whose}: commands late by more than"
            f" {timeout_s:g} s are dropped; {advice}"
        )
    if age_s < -timeout_s:
        raise InvalidArgument(
            f"the command is {-age_s:.3g} s ahead of {whose}: commands ahead by more than"
            f" {timeout_s:g} s are dropped; {advice}"
        )


class RejectionLog:
    """Log of the first rejection of each kind, until a command is accepted again.

    Two rejections are of one kind when they concern the same axes of the same topic and their
    texts differ in numbers only. Beyond a number of axes and texts nothing is logged until a
    command is accepted, so that no client can fill the memory or the disk. All is forgotten after
    ``PAUSE_S``. Any thread.

    Args:
        host: its ``on_rejection`` is called with what is logged.
    """

    def __init__(self, host: RosHost) -> None:
        self._host = host
        self._known: dict[tuple[str, tuple[int, ...]], set[str]] = {}
        self._rejected_s = 0.0

    def rejected(self, topic: str, axes: Sequence[int], reason: str) -> None:
        """A message on ``topic`` was not executed."""
        before_s, self._rejected_s = self._rejected_s, time.monotonic()
        if self._rejected_s - before_s > PAUSE_S:
            self._known.clear()
        concerned = (topic, tuple(axes[:MAX_AXES]))
        if concerned not in self._known:
            if len(self._known) == MAX_KNOWN:
                return
            self._known[concerned] = set()
            if len(self._known) == MAX_KNOWN:
                log.warning("rejections of other axes are hidden until a command is accepted")
        reason = shortened(reason)
        kinds = self._known[concerned]
        kind = _NUMBERS.sub("#", reason)
        if kind not in kinds and len(kinds) < MAX_KINDS:
            kinds.add(kind)
            log.warning("command rejected", topic=topic, axes=list(concerned[1]), reason=reason)
            self._host.on_rejection(topic, concerned[1], reason)
            if len(kinds) == MAX_KINDS:
                log.warning("other reasons are hidden until a command is accepted", topic=topic)

    def accepted(self, topic: str, axes: Sequence[int]) -> None:
        """A message on ``topic`` was executed: the next rejection is news again."""
        if len(self._known) == MAX_KNOWN:
            self._known.clear()
        self._known.pop((topic, tuple(axes[:MAX_AXES])), None)

    @contextmanager
    def noting(self, topic: str, axes: Sequence[int] = ()) -> Iterator[None]:
        """Note that a message is executed by the block, or the RobotdError that rejects it."""
        try:
            yield
        except RobotdError as error:
            self.rejected(topic, axes, str(error))
        else:
            self.accepted(topic, axes)
