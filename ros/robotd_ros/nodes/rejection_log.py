"""Log of rejected commands of topics: one line, and one message, for each reason."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from robotd.errors import RobotdError
from robotd.log import get_logger
from robotd_ros.host import RosHost

log = get_logger("commands")

MAX_KNOWN = 256  # axes that are remembered
MAX_AXES = 128  # of one message
MAX_KINDS = 16  # of texts, which may contain names that a client makes up
PAUSE_S = 2.0  # without a rejection; the next is of another attempt

_NUMBERS = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")


class RejectionLog:
    """Log of the first rejection of each kind, until a command is accepted again.

    Two rejections are of one kind when they concern the same axes of the same topic and their
    texts differ in numbers only. A flood of ever other axes or texts is cut off until a command
    is accepted, so that no client can fill the memory or the disk. All is forgotten after
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
