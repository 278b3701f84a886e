"""Notifications to a service manager: the datagram protocol of sd_notify(3)."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from typing import Self

from robotd.api import get_logger

log = get_logger("service")

MICROSECONDS = 1e6


class NotifySocket:
    """Socket that the service manager names in ``NOTIFY_SOCKET``. Any thread.

    Attributes:
        watchdog_s: period within which the manager expects ``WATCHDOG=1``; None: it does not.
    """

    def __init__(self, address: str, watchdog_s: float | None = None) -> None:
        # A leading @ is the abstract name space of Linux.
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self.watchdog_s = watchdog_s
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
        self._socket.setblocking(False)
        self._failing = False

    @classmethod
    def of_environment(cls, variables: Mapping[str, str] = os.environ) -> Self | None:
        """Return the socket of this process; None where no service manager started it."""
        address = variables.get("NOTIFY_SOCKET", "")
        if not address.startswith(("/", "@")):
            return None
        watchdog = variables.get("WATCHDOG_USEC", "")
        is_ours = variables.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        has_watchdog = watchdog.isdecimal() and int(watchdog) > 0 and is_ours
        return cls(address, int(watchdog) / MICROSECONDS if has_watchdog else None)

    def send(self, *assignments: str) -> None:
        """Send assignments such as ``READY=1``; a failure is logged once and harms nothing."""
        try:
            self._socket.sendto("\n".join(assignments).encode(), self._address)
            self._failing = False
        except OSError as error:
            if not self._failing:
                log.warning("the service manager is not notified", reason=str(error))
            self._failing = True

    def close(self) -> None:
        """Close the socket; the manager's own stays."""
        self._socket.close()
