"""Health of a robot, for probes and for the service manager that a thread keeps informed."""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Self

from robotd.api import NANOSECONDS, get_logger
from robotd.api.features import identity
from robotd.api.robots import Robot, SimulatedClock

log = get_logger("service")

STATUS_INTERVAL_S = 1.0
WATCHDOG_SHARE = 3  # notifications in each watchdog period
MICROSECONDS = 1e6
LOOP_TIMEOUT_S = 3.0  # the loop's own watchdog stops the axes after 1 s; a busy computer needs less


@dataclass(frozen=True)
class ProbedHealth:
    """Health of a robot at one moment.

    Attributes:
        alive: the control loop runs, or is not meant to: before the start, and at the end.
        ready: alive, and nothing keeps the axes from moving.
        state: one line: what hangs, the first problem, or "ready".
        problems: all that keeps axes from moving, the root cause first.
    """

    alive: bool
    ready: bool
    state: str
    problems: tuple[str, ...]


class RobotProbe:
    """Evaluates a robot's health. Any thread.

    Args:
        robot: may be started or not.
    """

    def __init__(self, robot: Robot, namespace: str) -> None:
        self._robot = robot
        self._identity = identity(robot, namespace)
        self._began_s = time.monotonic()
        self._period = (0, self._began_s)  # start of the newest period seen, and when it was seen

    def look(self) -> ProbedHealth:
        """Return the health now."""
        robot = self._robot
        if hang := self._hang():
            return ProbedHealth(alive=False, ready=False, state=hang, problems=(hang,))
        problems = tuple(robot.problems)
        ready = robot.connection.ready and not problems
        if ready:
            state = "ready"
        elif step := robot.connection.step.text:  # of a start-up: its problems are no news
            state = step
        else:
            state = problems[0] if problems else f"the device is {robot.connection.state.value}"
        return ProbedHealth(alive=True, ready=ready, state=state, problems=problems)

    def document(self) -> dict[str, object]:
        """Return the health with the robot's identity, for programs."""
        stats = self._robot.control_loop.stats
        return {
            **self._identity,
            **asdict(self.look()),
            "uptime_s": round(time.monotonic() - self._began_s, 1),
            "periods": stats.cycles,
            "missed_deadlines": stats.missed,
        }

    def _hang(self) -> str:
        """Return why the control loop is not alive; "" while it is."""
        loop, now_s = self._robot.control_loop, time.monotonic()
        work_s = loop.work_ns() / NANOSECONDS
        if work_s > LOOP_TIMEOUT_S:
            return f"the control loop hangs: a period takes {work_s:.1f} s"
        # Simulated time may stand still.
        if not loop.is_started or isinstance(self._robot.clock, SimulatedClock):
            self._period = (0, now_s)
            return ""
        start_ns = loop.started_ns
        if start_ns != self._period[0]:
            self._period = (start_ns, now_s)
        idle_s = now_s - self._period[1]
        if idle_s > LOOP_TIMEOUT_S:
            return f"the control loop has begun no period for {idle_s:.1f} s"
        return ""


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
