"""Log of rejected requests and goals: one line, once per client and second."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any

from robotd.errors import RobotdError
from robotd.log import get_logger, shortened
from robotd_ros.middleware import PREFIX_BYTES, request_id_of

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

log = get_logger("ros")

PERIOD_S = 1.0
MAX_KNOWN = 256


class RequestLog:
    """Log of rejected requests of clients; repeats within a second are counted. Any thread.

    The client has the reason of each rejection in its answer.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        # Earliest time of the next line, and rejections without one; by client and kind of error.
        self._known: dict[tuple[bytes, bool], tuple[float, int]] = {}

    def rejected(
        self,
        header: Any,
        event: str,
        error: Exception,
        own_log: FilteringBoundLogger = log,
        **fields: Any,
    ) -> None:
        """Log a rejection; of an exception that is not a RobotdError with its traceback.

        Args:
            header: of the request, from rclpy; None: its client is not known.
            event: text of the line.
            error: reason of the rejection.
            own_log: of the line.
            fields: more of the line.
        """
        request = request_id_of(header)
        client = bytes(request.guid)[:PREFIX_BYTES] if request else b""
        is_own_fault = not isinstance(error, RobotdError)
        key, now_s = (client, is_own_fault), time.monotonic()
        with self._lock:
            next_s, hidden = self._known.get(key, (0.0, 0))
            if now_s < next_s:
                self._known[key] = next_s, hidden + 1
                return
            if key not in self._known and len(self._known) >= MAX_KNOWN:
                self._known.clear()
            self._known[key] = now_s + PERIOD_S, 0
        if hidden:
            fields["hidden"] = hidden  # since the last line of this client
        if is_own_fault:
            own_log.error(event, **fields, exc_info=error)
        else:
            own_log.info(event, **fields, reason=shortened(str(error)))
