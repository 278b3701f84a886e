"""Reconnection of a lost device, and of one that comes late."""

from __future__ import annotations

import threading

from robotd.device.connection import Connection
from robotd.errors import RobotdError
from robotd.log import get_logger

log = get_logger("connection")

MIN_INTERVAL_S = 0.1
END_TIMEOUT_S = 15.0  # for an attempt that is under way


class Reconnector:
    """Thread ``robotd-reconnect``: restores communication while it is lost. Servos stay off.

    ``connection``: attempts are made while it is ``lost``, one every ``open_retry_s``.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._interval_s = max(connection.settings.open_retry_s, MIN_INTERVAL_S)
        self._failure: str | None = None  # of the outage that was reported
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start the thread; no effect while it runs. One thread."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="robotd-reconnect", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """End the thread and wait for it; a second call has no effect."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(END_TIMEOUT_S)

    def attempt(self) -> None:
        """Restore the connection if it is lost; report the first failure of an outage."""
        if not self._connection.lost:
            self._failure = None
            return
        try:
            self._connection.restore_if_lost()  # it may be being stopped on purpose now
        except RobotdError as error:
            self._report(str(error))
        except Exception as error:  # noqa: BLE001 - of a plugin; the next attempt may succeed
            self._report(f"{type(error).__name__}: {error}")
        else:
            if self._failure is not None and self._connection.ready:
                log.info("reconnected; servos stay off", advice="robotd recover")
                self._failure = None

    def _report(self, failure: str) -> None:
        write = log.warning if self._failure is None else log.debug
        write("reconnecting", every_s=self._interval_s, reason=failure)
        self._failure = failure

    def _run(self) -> None:
        while not self._stop.wait(self._interval_s):
            self.attempt()
