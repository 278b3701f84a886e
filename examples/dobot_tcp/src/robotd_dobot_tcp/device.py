"""Connection life cycle: idle → connected (RUNNING) → communicating."""

from __future__ import annotations

from collections.abc import Callable

from robotd.api import (
    Clock,
    ConnectionState,
    DeviceDriver,
    DeviceTimeout,
    NotReady,
    RobotdError,
    get_logger,
    wait_until,
)
from robotd_dobot_tcp.link import Feedback, Link
from robotd_dobot_tcp.options import DobotOptions
from robotd_dobot_tcp.protocol import MODES

log = get_logger("dobot_tcp")

CLOSE_S = 1.0  # for the servos to go off


class DobotDevice(DeviceDriver):
    """The controller. Drivers of axes and I/O use its ``link``.

    Attributes:
        communicating: values and targets are exchanged.
    """

    def __init__(self, options: DobotOptions, clock: Clock) -> None:
        self.communicating = False
        self.options, self.clock = options, clock
        self._link: Link | None = None

    @property
    def link(self) -> Link:
        """The connections. Raises NotReady while they are not there."""
        if self._link is None or self._link.failure:
            raise NotReady(self.fault() or "the controller is not connected")
        return self._link

    @property
    def feedback(self) -> Feedback | None:
        """Newest values; None while they do not count."""
        return self._link.feedback if self._link and self.communicating else None

    def open(self, path: str = "", name: str = "") -> None:
        if self.state() is ConnectionState.IDLE:
            self._disconnect()  # what is left of lost connections
            options = self.options.model_copy(update={"address": path} if path else {})
            self._link = Link(options, self.clock)

    def close(self) -> None:
        self.stop_communication(CLOSE_S)
        self._disconnect()

    def start_communication(self, timeout_s: float) -> None:
        began_ns = self.clock.now_ns()
        self.wait_for(lambda values: values.time_ns > began_ns, timeout_s, "feedback")
        self.link.command("SpeedFactor", 100)
        self.communicating = True

    def stop_communication(self, timeout_s: float) -> None:
        if not self.communicating:
            return
        self.communicating = False
        try:
            self.link.command("DisableRobot")
            self.wait_for(lambda values: not values.enabled, timeout_s, "the servos to be off")
        except RobotdError as error:
            log.warning("servos may be on: the controller does not answer", reason=str(error))

    def state(self) -> ConnectionState:
        if self._link is None or self._link.failure:
            return ConnectionState.IDLE
        return ConnectionState.COMMUNICATING if self.communicating else ConnectionState.RUNNING

    def fault(self) -> str:
        return self._link.silence if self._link else ""

    def scan_network(self) -> str:
        mode = int(self.link.command("RobotMode"))
        return f"controller at {self.options.address}, {MODES.get(mode, f'mode {mode}')}"

    def wait_for(self, condition: Callable[[Feedback], bool], timeout_s: float, what: str) -> None:
        """Wait for feedback for which ``condition`` is true.

        Raises DeviceTimeout: no such feedback came. NotReady: the connections are lost.
        """

        def found() -> bool:
            values = self.link.feedback
            return values is not None and condition(values)

        if not wait_until(found, timeout_s, self.clock):
            raise DeviceTimeout(f"waited {timeout_s:g} s for {what}")

    def _disconnect(self) -> None:
        self.communicating = False
        if self._link is not None:
            self._link.close()
            self._link = None
