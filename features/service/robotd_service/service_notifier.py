"""Thread that keeps a service manager informed while a robot runs."""

from __future__ import annotations

import threading
from typing import Self

from robotd.api import get_logger
from robotd_service.notify_socket import NotifySocket
from robotd_service.robot_probe import RobotProbe

log = get_logger("service")

STATUS_INTERVAL_S = 1.0
WATCHDOG_SHARE = 3  # notifications in each watchdog period


class ServiceNotifier:
    """Thread ``robotd-notify``: sends STATUS on changes, and WATCHDOG while the loop is alive.

    It never restarts anything itself: the manager does, when the notifications end.

    Args:
        socket: of the service manager.
        probe: of the robot.
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
