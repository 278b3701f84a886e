"""Thread that keeps a service manager informed while a robot runs."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Mapping
from typing import Self

from robotd.api import get_logger
from robotd_service.robot_probe import RobotProbe

log = get_logger("service")

STATUS_INTERVAL_S = 1.0
WATCHDOG_SHARE = 3  # notifications in each watchdog period
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


class ServiceNotifier:
    """Thread ``robotd-notify``: sends STATUS on changes, and WATCHDOG while the loop is alive.

    It never restarts anything itself: the manager does, when the notifications end.
    """

    def __init__(self, socket: NotifySocket, probe: RobotProbe) -> None:
        self._socket, self._probe = socket, probe
        watchdog_s = socket.watchdog_s
        self._interval_s = min(STATUS_INTERVAL_S, (watchdog_s or 3600.0) / WATCHDOG_SHARE)
        self._status = ""
        self._was_alive = True
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="robotd-notify", daemon=True)

    def ready(self) -> None:
        """Report the end of the start: the robot's nodes answer. Any thread."""
        self._socket.send("READY=1")

    def notify(self) -> None:
        """Look at the robot once and send what follows."""
        health = self._probe.look()
        if health.alive and self._socket.watchdog_s is not None:
            self._socket.send("WATCHDOG=1")
        if self._was_alive and not health.alive:
            log.error("the service manager's watchdog is not notified", reason=health.state)
        self._was_alive = health.alive
        if health.state != self._status:
            self._status = health.state
            self._socket.send(f"STATUS={health.state.splitlines()[0]}")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self._socket.send("STOPPING=1")
        self._socket.close()

    def _run(self) -> None:
        while not self._stop.wait(self._interval_s):
            try:
                self.notify()
            except Exception:
                log.exception("notifying the service manager failed")
