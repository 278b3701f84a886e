"""Commands that come as a stream are refused as a stream: one line of log for each reason."""

from __future__ import annotations

import re
from collections.abc import Sequence

from robotd.log import get_logger

log = get_logger("commands")

_NUMBERS = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")


class RefusalLog:
    """Logs the first refusal of each kind until a command on the same axes is accepted again.

    Two refusals are of one kind when they concern the same axes of the same topic and their
    texts differ in numbers only. One thread: the executor's.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[str, tuple[int, ...]], set[str]] = {}

    def refused(self, topic: str, axes: Sequence[int], reason: str) -> None:
        """A message on ``topic`` was not obeyed."""
        kinds = self._known.setdefault((topic, tuple(axes)), set())
        kind = _NUMBERS.sub("#", reason)
        if kind not in kinds:
            kinds.add(kind)
            log.warning("command refused", topic=topic, axes=list(axes), reason=reason)

    def accepted(self, topic: str, axes: Sequence[int]) -> None:
        """A message on ``topic`` was obeyed: the next refusal is news again."""
        self._known.pop((topic, tuple(axes)), None)
