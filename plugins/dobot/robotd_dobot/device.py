"""Connection life cycle: idle → connected (RUNNING) → communicating."""

from __future__ import annotations

from collections.abc import Callable

from robotd.api import (
    Clock,
    ConnectionState,
    DeviceDriver,
    DeviceTimeout,
    NotReady,
    Payload,
    RobotdError,
    get_logger,
    wait_until,
)
from robotd_dobot.link import SWITCH_OFF, ControllerLink, Feedback, switch_off
from robotd_dobot.options import DobotOptions
from robotd_dobot.protocol import in_kg_and_mm
from robotd_dobot.tool_terminals import ToolTerminals

log = get_logger("dobot")

CLOSE_S = 1.0  # for the servos to go off


class DobotDevice(DeviceDriver):
    """The controller. Drivers of axes and I/O use its ``link``.

    Attributes:
        communicating: values and targets are exchanged.
        payload: that was set since the device was opened; None: that of the options applies.
    """

    def __init__(self, options: DobotOptions, clock: Clock) -> None:
        self.communicating = False
        self.options, self.clock = options, clock
        self.payload: Payload | None = None
        self._link: ControllerLink | None = None

    @property
    def link(self) -> ControllerLink:
        """The connections. Raises NotReady while they are not there."""
        if self._link is None or self._link.failure:
            raise NotReady(self.fault() or "the controller is not connected")
        return self._link

    @property
    def exchanging(self) -> ControllerLink | None:
        """The connections while values and targets count; else None."""
        link = self._link
        return link if link and self.communicating and not link.failure else None

    @property
    def feedback(self) -> Feedback | None:
        """Newest values; None while they do not count."""
        return self._link.feedback if self._link and self.communicating else None

    @property
    def tool(self) -> ToolTerminals | None:
        """Terminals of the tool; None while they do not count, or are left out."""
        return self._link.tool if self._link and self.communicating else None

    def open(self, path: str = "", name: str = "") -> None:
        if self.state() is ConnectionState.IDLE:
            self._disconnect()  # what is left of lost connections
            options = self.options.model_copy(update={"address": path} if path else {})
            self._link = ControllerLink(options, self.clock)

    def close(self) -> None:
        self.stop_communication(CLOSE_S)
        self._disconnect()
        self.payload = None

    def start_communication(self, timeout_s: float) -> None:
        began_ns = self.clock.now_ns()
        self.link.take_control()
        self.wait_for(lambda values: values.time_ns > began_ns, timeout_s, "feedback")
        self.communicating = True

    def stop_communication(self, timeout_s: float) -> None:
        if not self.communicating:
            return
        self.communicating = False
        try:
            self.switch_off(timeout_s)
        except RobotdError as error:
            log.warning("servos may be on: the controller does not answer", reason=str(error))

    def state(self) -> ConnectionState:
        if self._link is None or self._link.failure:
            return ConnectionState.IDLE
        return ConnectionState.COMMUNICATING if self.communicating else ConnectionState.RUNNING

    def fault(self) -> str:
        return self._link.silence if self._link else ""

    def scan_network(self) -> str:
        link = self.link
        values = link.feedback
        if values is None:
            return f"controller {link.dialect.name} at {self.options.address}: no feedback"
        model = values.model or "arm"
        mode = link.dialect.mode_text(values.mode)
        return f"{model} on a controller {link.dialect.name} at {self.options.address}: {mode}"

    @property
    def payload_to_enable(self) -> tuple[float, ...]:
        """Arguments of the command that switches the arm on: kg and mm; empty: the controller's."""
        return self.options.payload if self.payload is None else in_kg_and_mm(self.payload)

    def switch_off(self, timeout_s: float) -> None:
        """Switch the servos off, also where the connections are lost.

        Raises RobotdError: the controller has not confirmed it.
        """
        if self._link is not None and not self._link.failure:
            try:
                self._link.command(SWITCH_OFF, timeout_s=timeout_s)
                self.wait_for(lambda values: not values.enabled, timeout_s, "the servos to be off")
            except NotReady:
                if not self._link.failure:
                    raise
            else:
                return
        switch_off(self.options, self.clock, timeout_s)

    def select_frames(self, timeout_s: float) -> None:
        """Select the frames of the options, once the arm is on: V4 queues these commands.

        Raises OperationError: there is no such frame. DeviceTimeout: the feedback does not show it.
        """
        frames = self.options.frames.items()
        for name, index in frames:
            self.link.command(name, index)
        shown = " and ".join(f"{name}({index})" for name, index in frames)
        what = f"the controller to show {shown}"
        self.wait_for(lambda values: frames <= values.frames.items(), timeout_s, what)

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
